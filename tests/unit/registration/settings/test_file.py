import math
import tomllib
from dataclasses import dataclass, replace

import pytest

from scanlock.errors import FormatError, InvalidInput
from scanlock.optimisation.solvers.bfgs import Bfgs
from scanlock.optimisation.solvers.criteria import ConvergenceCriteria
from scanlock.optimisation.solvers.levenberg_marquardt import LevenbergMarquardt
from scanlock.optimisation.solvers.more_thuente import MoreThuente
from scanlock.optimisation.solvers.newton import Newton
from scanlock.registration.methods.coarse_to_fine import PAPER_SCALES, CoarseToFine, Scale
from scanlock.registration.methods.correspondences import NearestNeighbourSearch, VoxelSearch
from scanlock.registration.methods.gicp import Gicp
from scanlock.registration.methods.rejection import TrimmedRejection
from scanlock.registration.methods.sgc_ndt import SgcNdt
from scanlock.registration.registry import METHODS
from scanlock.registration.settings.file import (
    read_settings,
    settings_from_toml,
    settings_to_toml,
    write_settings,
)
from scanlock.segmentation.cluster_gaussians import ClusterGaussianExtractor
from scanlock.segmentation.clusters import ClusterFinder, L2Distance
from scanlock.segmentation.ground.finder import GroundFinder
from scanlock.segmentation.segmentation import Segmenter


def _with_segmenter(**parts):
    return SgcNdt(extractor=ClusterGaussianExtractor(segmenter=Segmenter(**parts)))


@pytest.mark.parametrize("name", METHODS)
def test_every_method_comes_back_the_same(name):
    text = settings_to_toml(METHODS[name])
    assert settings_from_toml(text) == METHODS[name]
    assert tomllib.loads(text)["type"] == type(METHODS[name]).__name__
    assert settings_from_toml(f'method = "{name}"') == METHODS[name]


@pytest.mark.parametrize(
    "settings",
    [
        SgcNdt(schedule=CoarseToFine(scales=PAPER_SCALES, solver=Bfgs())),
        SgcNdt(schedule=CoarseToFine(solver=Bfgs(line_search=MoreThuente(flatness=0.1 + 0.2)))),
        SgcNdt(
            score="p2d",
            schedule=CoarseToFine(
                solver=LevenbergMarquardt(criteria=ConvergenceCriteria(step_tolerance=1e-300))
            ),
        ),
        _with_segmenter(clusters=ClusterFinder(merge=L2Distance())),
        _with_segmenter(ground=GroundFinder.das2013()),
        Gicp(search=NearestNeighbourSearch(max_correspondence_distances=(3,))),
        Gicp(search=VoxelSearch(), rejection=TrimmedRejection()),
    ],
    ids=["bfgs", "more-thuente", "lm", "merge", "ground", "gicp", "vgicp"],
)
def test_other_choices_come_back_too(settings, tmp_path):
    write_settings(tmp_path / "settings.toml", settings)
    assert read_settings(tmp_path / "settings.toml") == settings


def test_what_is_left_out_has_its_default():
    assert settings_from_toml('type = "SgcNdt"') == SgcNdt()
    text = 'type = "SgcNdt"\nscore = "p2d"\nspacing = 1\n[schedule.solver]\ntype = "Bfgs"\n'
    found = settings_from_toml(text)
    assert found == SgcNdt(score="p2d", voxel_size=1.0, schedule=CoarseToFine(solver=Bfgs()))
    assert isinstance(found.spacing, float)


def test_a_part_that_is_touched_keeps_the_rest_of_its_default():
    # The default is not what LevenbergMarquardt alone would be.
    default = METHODS["gicp"].solver
    assert default != LevenbergMarquardt()
    for head in (
        'type = "Gicp"\n[solver]',
        'method = "gicp"\n[solver]\ntype = "LevenbergMarquardt"',
    ):
        found = settings_from_toml(f"{head}\nlever = 5.0")
        assert found == Gicp(solver=replace(default, rotation_scale=5.0))
    other = settings_from_toml('type = "Gicp"\n[solver]\ntype = "Newton"\nlever = 5.0')
    assert other == Gicp(solver=Newton(rotation_scale=5.0))


def test_a_list_of_tables_is_all_there_is():
    found = settings_from_toml(
        'type = "SgcNdt"\n[[schedule.scales]]\nblur = 2\nlargest_radius = 3\nis_entry = true\n'
    )
    assert found.schedule.scales == (Scale(smoothing=2.0, max_radius=3.0, is_entry=True),)


def test_none_is_written_where_the_default_is_something():
    text = settings_to_toml(_with_segmenter(ground=GroundFinder(seed_count=None)))
    assert '\n# seed_count = "none"\n' in text
    given = settings_from_toml(text.replace('# seed_count = "none"', "seed_count = 3"))
    assert given.landmarks.segmenter.ground.seed_count == 3
    none = settings_from_toml(text.replace("# seed_count", "seed_count"))
    assert none.landmarks.segmenter.ground.seed_count is None


def test_numbers_without_end_are_kept():
    text = settings_to_toml(METHODS["sgc-ndt-d2d"])
    assert "\nseed_range = inf\n" in text
    assert math.isinf(settings_from_toml(text).landmarks.segmenter.ground.seed_range)


def test_each_setting_is_explained_once_with_its_choices():
    text = settings_to_toml(METHODS["sgc-ndt-d2d"])
    lines = text.splitlines()
    assert max(map(len, lines)) <= 100
    place = lines.index('score = "d2d"')
    assert lines[place - 2].startswith("# Gaussians of the source, or its obstacle points")
    assert lines[place - 1].endswith('One of "d2d", "p2d".')
    assert "One of Newton, LineSearchNewton," in text
    assert text.count("# Standard deviation added to every Gaussian [m]") == 1
    assert text.count("[[schedule.scales]]") == len(SgcNdt().schedule.scales)
    assert "`" not in text


def _mistake(line, table="", head='type = "SgcNdt"'):
    return f"{head}\n{table}\n{line}"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("spacing = \n", r"mine: not TOML: .*line 1"),
        ("spacing = 1", "mine: type must be given: one of .*SgcNdt"),
        ('type = "Path"', r"mine: type must be one of .*SgcNdt.*, got 'Path'"),
        ('type = ["SgcNdt"]', r"mine: type must be one of .*, got \['SgcNdt'\]"),
        ('type = "sgcndt"', "; did you mean SgcNdt"),
        ('method = "sgc-ndt"', "mine: method must be one of auto, sgc.*; did you mean sgc-ndt-"),
        ("method = [1]", r"mine: method must be one of .*, got \[1\]"),
        ('method = "gicp"\ntype = "SgcNdt"', "mine: type repeats what method says"),
        (_mistake("spacings = 1"), "mine: spacings is no setting of SgcNdt, which has score, .*; "
                                   "did you mean spacing"),
        (_mistake("__class__ = 1"), "mine: __class__ is no setting of SgcNdt"),
        (_mistake("spacing = true"), "mine: spacing must be a number, got True"),
        (_mistake('spacing = "wide"'), "mine: spacing must be a number, got 'wide'"),
        (_mistake("spacing = 2026-11-23"), "mine: spacing must be a number, got datetime"),
        (_mistake("spacing = -1"), r"mine: spacing must be positive, got -1\.0 m"),
        (_mistake("spacing = nan"), "mine: spacing must be positive, got nan m"),
        (_mistake('score = "p3d"'), """mine: score must be one of "d2d", "p2d", got 'p3d'"""),
        (_mistake("score = 1"), 'mine: score must be one of "d2d", "p2d", got 1'),
        (_mistake("schedule = 3"), "mine: schedule must be a table of CoarseToFine, got 3"),
        (_mistake("scales = 3", "[schedule]"),
         r"mine: schedule\.scales must be a list, each a table of Scale, got 3"),
        (_mistake("scales = []", "[schedule]"), "mine: schedule: blur must not grow"),
        (_mistake('type = "Path"', "[schedule.solver]"),
         r"schedule\.solver\.type must be one of Bfgs, .*, got 'Path'"),
        (_mistake("step = 0", "[schedule.solver.stopping]"),
         r"mine: schedule\.solver\.stopping: step must be positive, got 0\.0 m"),
        (_mistake("iterations = 1.5", "[schedule.solver.stopping]"),
         r"schedule\.solver\.stopping\.iterations must be a whole number, got 1\.5"),
        (_mistake("blur = 1.0", "[[schedule.scales]]"),
         r"schedule\.scales\[0\]: Scale needs largest_radius, a number"),
        (_mistake('blur = "1"\nlargest_radius = 1', "[[schedule.scales]]"),
         r"schedule\.scales\[0\]\.blur must be a number, got '1'"),
        (_mistake("is_entry = 1", "[[schedule.scales]]\nblur = 1\nlargest_radius = 1"),
         r"schedule\.scales\[0\]\.is_entry must be true or false, got 1"),
        (_mistake('seed_count = "all"', "[landmarks.segmenter.ground]"),
         "ground.seed_count must be a whole number or \"none\", got 'all'"),
        (_mistake('max_correspondence_distances = ["wide"]', "[search]", 'type = "Gicp"'),
         r"search\.max_correspondence_distances\[0\] must be a number"),
    ],
)  # fmt: skip
def test_a_mistake_names_its_key_and_the_remedy(text, message):
    with pytest.raises(InvalidInput, match=message):
        settings_from_toml(text, "mine")


def test_files_are_named_in_errors(tmp_path):
    path = tmp_path / "x.toml"
    path.write_bytes(b"\xff\xfe")
    with pytest.raises(InvalidInput, match=r"x\.toml: not TOML: byte 0 is no text in UTF-8"):
        read_settings(path)
    path.write_text('type = "SgcNdt"\nspacing = 0')
    with pytest.raises(InvalidInput, match=r"x\.toml: spacing must be positive"):
        read_settings(path)
    path.write_bytes(b"")
    with pytest.raises(FormatError, match="an empty file"):
        read_settings(path)
    with pytest.raises(FileNotFoundError):
        read_settings(tmp_path / "y.toml")


def test_files_saved_on_windows_are_read(tmp_path):
    path = tmp_path / "x.toml"
    path.write_bytes(b'\xef\xbb\xbftype = "SgcNdt"\r\nspacing = 0.25\r\n')
    assert read_settings(path) == SgcNdt(voxel_size=0.25)


@dataclass(frozen=True)
class _Mine:
    limit: float = 1.0

    def merges(self, first, second):
        return first.means[:, 0] < self.limit


def test_settings_that_could_not_be_read_are_not_written(tmp_path):
    with pytest.raises(InvalidInput, match=r"only .*SgcNdt.* can be written, got _Mine"):
        settings_to_toml(_Mine())
    settings = _with_segmenter(clusters=ClusterFinder(merge=_Mine()))
    with pytest.raises(InvalidInput, match=r"ClusterFinder\.merge must be a table of MeanDistance"):
        write_settings(tmp_path / "x.toml", settings)
    assert list(tmp_path.iterdir()) == []


def test_a_changed_number_is_the_only_thing_that_changes():
    method = METHODS["sgc-ndt-p2d"]
    lines = [
        settings_to_toml(one).splitlines() for one in (method, replace(method, voxel_size=0.25))
    ]
    changed = [pair for pair in zip(*lines, strict=True) if pair[0] != pair[1]]
    assert changed == [("spacing = 0.5", "spacing = 0.25")]
