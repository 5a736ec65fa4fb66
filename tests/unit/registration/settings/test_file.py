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
from scanlock.registration.methods.gicp import Gicp
from scanlock.registration.methods.icp.correspondences import NearestNeighbourSearch, VoxelSearch
from scanlock.registration.methods.icp.distance_rejection import TrimmedRejection
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
from scanlock.segmentation.ground.finder import PublishedGroundFinder
from scanlock.segmentation.segmentation import Segmenter


def _with_segmenter(**segmenter):
    return SgcNdt(extractor=ClusterGaussianExtractor(segmenter=Segmenter(**segmenter)))


@pytest.mark.parametrize("name", METHODS)
def test_every_method_round_trips_through_toml(name):
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
        _with_segmenter(ground=PublishedGroundFinder()),
        Gicp(search=NearestNeighbourSearch(max_correspondence_distances=(3,))),
        Gicp(search=VoxelSearch(), rejection=TrimmedRejection()),
    ],
    ids=["bfgs", "more-thuente", "lm", "merge", "ground", "gicp", "vgicp"],
)
def test_settings_other_than_the_defaults_round_trip_through_a_file(settings, tmp_path):
    write_settings(tmp_path / "settings.toml", settings)
    assert read_settings(tmp_path / "settings.toml") == settings


def test_keys_that_are_left_out_have_their_defaults():
    assert settings_from_toml('type = "SgcNdt"') == SgcNdt()
    text = 'type = "SgcNdt"\nscore = "p2d"\nvoxel_size = 1\n[schedule.solver]\ntype = "Bfgs"\n'
    found = settings_from_toml(text)
    assert found == SgcNdt(score="p2d", voxel_size=1.0, schedule=CoarseToFine(solver=Bfgs()))
    assert isinstance(found.voxel_size, float)


def test_a_changed_table_keeps_the_other_defaults_of_the_method():
    # The default is not what LevenbergMarquardt alone would be.
    default = METHODS["gicp"].solver
    assert default != LevenbergMarquardt()
    for head in (
        'type = "Gicp"\n[solver]',
        'method = "gicp"\n[solver]\ntype = "LevenbergMarquardt"',
    ):
        found = settings_from_toml(f"{head}\nrotation_scale = 5.0")
        assert found == Gicp(solver=replace(default, rotation_scale=5.0))
    other = settings_from_toml('type = "Gicp"\n[solver]\ntype = "Newton"\nrotation_scale = 5.0')
    assert other == Gicp(solver=Newton(rotation_scale=5.0))


def test_a_list_of_tables_replaces_the_whole_default():
    found = settings_from_toml(
        'type = "SgcNdt"\n[[schedule.scales]]\nsmoothing = 2\nmax_radius = 3\nstarts_here = true\n'
    )
    assert found.schedule.scales == (Scale(smoothing=2.0, max_radius=3.0, starts_here=True),)


def test_none_is_commented_out_where_it_is_the_default():
    text = settings_to_toml(_with_segmenter(ground=PublishedGroundFinder(max_seeds=None)))
    assert '\nmax_seeds = "none"\n' in text
    given = settings_from_toml(text.replace('max_seeds = "none"', "max_seeds = 3"))
    assert given.extractor.segmenter.ground.max_seeds == 3
    none = settings_from_toml(text)
    assert none.extractor.segmenter.ground.max_seeds is None


def test_none_is_a_comment_where_the_default_is_none():
    text = settings_to_toml(METHODS["icp"])
    assert '\n# annealing = "none"\n' in text
    none = settings_from_toml(text.replace("# annealing", "annealing"))
    assert none.annealing is None


def test_infinite_values_are_kept():
    text = settings_to_toml(METHODS["sgc-ndt-d2d"])
    assert "\nmax_seed_range = inf\n" in text
    assert math.isinf(settings_from_toml(text).extractor.segmenter.ground.max_seed_range)


def test_each_setting_is_documented_once_with_its_choices():
    text = settings_to_toml(METHODS["sgc-ndt-d2d"])
    lines = text.splitlines()
    assert max(map(len, lines)) <= 100
    row = lines.index('score = "d2d"')
    assert lines[row - 2].startswith("# Gaussians of the source, or its obstacle points")
    assert lines[row - 1].endswith('One of "d2d", "p2d".')
    assert "One of Newton, LineSearchNewton," in text
    assert text.count("# Standard deviation added to every Gaussian [m]") == 1
    assert text.count("[[schedule.scales]]") == len(SgcNdt().schedule.scales)
    assert "`" not in text


def _toml(line, table="", head='type = "SgcNdt"'):
    return f"{head}\n{table}\n{line}"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("voxel_size = \n", r"mine: not TOML: .*line 1"),
        ("voxel_size = 1", "mine: type must be given: one of .*SgcNdt"),
        ('type = "Path"', r"mine: type must be one of .*SgcNdt.*, got 'Path'"),
        ('type = ["SgcNdt"]', r"mine: type must be one of .*, got \['SgcNdt'\]"),
        ('type = "sgcndt"', "; did you mean SgcNdt"),
        ('method = "sgc-ndt"', "mine: method must be one of auto, sgc.*; did you mean sgc-ndt-"),
        ("method = [1]", r"mine: method must be one of .*, got \[1\]"),
        ('method = "gicp"\ntype = "SgcNdt"', "mine: type cannot be combined with method"),
        (_toml("voxel_siz = 1"), "mine: voxel_siz is not a setting of SgcNdt, which has "
                                    "score, .*; did you mean voxel_size"),
        (_toml("__class__ = 1"), "mine: __class__ is not a setting of SgcNdt"),
        (_toml("voxel_size = true"), "mine: voxel_size must be a number, got True"),
        (_toml('voxel_size = "wide"'), "mine: voxel_size must be a number, got 'wide'"),
        (_toml("voxel_size = 2026-11-23"), "mine: voxel_size must be a number, got datetime"),
        (_toml("voxel_size = -1"), r"mine: voxel_size must be positive, got -1\.0 m"),
        (_toml("voxel_size = nan"), "mine: voxel_size must be positive, got nan m"),
        (_toml('score = "p3d"'), """mine: score must be one of "d2d", "p2d", got 'p3d'"""),
        (_toml("score = 1"), 'mine: score must be one of "d2d", "p2d", got 1'),
        (_toml("schedule = 3"), "mine: schedule must be a table of CoarseToFine, got 3"),
        (_toml("scales = 3", "[schedule]"),
         r"mine: schedule\.scales must be a list, each a table of Scale, got 3"),
        (_toml("scales = []", "[schedule]"), r"mine: schedule: .*, got \[\]"),
        (_toml('type = "Path"', "[schedule.solver]"),
         r"schedule\.solver\.type must be one of Bfgs, .*, got 'Path'"),
        (_toml("step_tolerance = 0", "[schedule.solver.criteria]"),
         r"mine: schedule\.solver\.criteria: step_tolerance must be positive, got 0\.0 m"),
        (_toml("max_iterations = 1.5", "[schedule.solver.criteria]"),
         r"schedule\.solver\.criteria\.max_iterations must be a whole number, got 1\.5"),
        (_toml("smoothing = 1.0", "[[schedule.scales]]"),
         r"schedule\.scales\[0\]: Scale needs max_radius, a number"),
        (_toml('smoothing = "1"\nmax_radius = 1', "[[schedule.scales]]"),
         r"schedule\.scales\[0\]\.smoothing must be a number, got '1'"),
        (_toml("starts_here = 1", "[[schedule.scales]]\nsmoothing = 1\nmax_radius = 1"),
         r"schedule\.scales\[0\]\.starts_here must be true or false, got 1"),
        (_toml('type = "PublishedGroundFinder"\nmax_seeds = "all"',
               "[extractor.segmenter.ground]"),
         "ground.max_seeds must be a whole number or \"none\", got 'all'"),
        (_toml('max_correspondence_distances = ["wide"]', "[search]", head='type = "Gicp"'),
         r"search\.max_correspondence_distances\[0\] must be a number"),
    ],
)  # fmt: skip
def test_an_invalid_key_or_value_is_refused_with_the_allowed_ones(text, message):
    with pytest.raises(InvalidInput, match=message):
        settings_from_toml(text, "mine")


def test_errors_name_the_file(tmp_path):
    path = tmp_path / "x.toml"
    path.write_bytes(b"\xff\xfe")
    with pytest.raises(InvalidInput, match=r"x\.toml: not TOML: byte 0 is not valid UTF-8"):
        read_settings(path)
    path.write_text('type = "SgcNdt"\nvoxel_size = 0')
    with pytest.raises(InvalidInput, match=r"x\.toml: voxel_size must be positive"):
        read_settings(path)
    path.write_bytes(b"")
    with pytest.raises(FormatError, match="an empty file"):
        read_settings(path)
    with pytest.raises(FileNotFoundError):
        read_settings(tmp_path / "y.toml")


def test_files_with_byte_order_mark_and_crlf_are_read(tmp_path):
    path = tmp_path / "x.toml"
    path.write_bytes(b'\xef\xbb\xbftype = "SgcNdt"\r\nvoxel_size = 0.25\r\n')
    assert read_settings(path) == SgcNdt(voxel_size=0.25)


@dataclass(frozen=True)
class _CustomMerge:
    limit: float = 1.0

    def merges(self, first, second):
        return first.means[:, 0] < self.limit


def test_settings_of_unknown_classes_are_not_written(tmp_path):
    with pytest.raises(InvalidInput, match=r"method must be of class .*SgcNdt.*, got _CustomMerge"):
        settings_to_toml(_CustomMerge())
    settings = _with_segmenter(clusters=ClusterFinder(merge=_CustomMerge()))
    with pytest.raises(InvalidInput, match=r"ClusterFinder\.merge must be a table of MeanDistance"):
        write_settings(tmp_path / "x.toml", settings)
    assert list(tmp_path.iterdir()) == []


def test_a_changed_value_changes_only_its_own_line():
    method = METHODS["sgc-ndt-p2d"]
    lines = [
        settings_to_toml(one).splitlines() for one in (method, replace(method, voxel_size=0.25))
    ]
    changed = [pair for pair in zip(*lines, strict=True) if pair[0] != pair[1]]
    assert changed == [("voxel_size = 0.5", "voxel_size = 0.25")]
