import math
import tomllib
from dataclasses import replace

import pytest

from scanlock.errors import InvalidInput
from scanlock.io.settings import (
    read_settings,
    settings_from_toml,
    settings_to_toml,
    write_settings,
)
from scanlock.models.clusters import ClusterFinder, L2Distance
from scanlock.models.segmentation import Segmenter
from scanlock.registration.coarse_to_fine import PAPER_SCALES, CoarseToFine
from scanlock.registration.landmarks import LandmarkFinder
from scanlock.registration.methods import METHODS
from scanlock.registration.sgc_ndt import SgcNdt
from scanlock.solvers.bfgs import Bfgs
from scanlock.solvers.levenberg_marquardt import LevenbergMarquardt
from scanlock.solvers.more_thuente import MoreThuente
from scanlock.solvers.stopping import Stopping


@pytest.mark.parametrize("name", METHODS)
def test_every_method_comes_back_the_same(name):
    text = settings_to_toml(METHODS[name])
    assert settings_from_toml(text) == METHODS[name]
    assert tomllib.loads(text)["type"] == type(METHODS[name]).__name__


@pytest.mark.parametrize(
    "settings",
    [
        SgcNdt(schedule=CoarseToFine(scales=PAPER_SCALES, solver=Bfgs())),
        SgcNdt(schedule=CoarseToFine(solver=Bfgs(line_search=MoreThuente(flatness=0.1 + 0.2)))),
        SgcNdt(
            score="p2d",
            schedule=CoarseToFine(solver=LevenbergMarquardt(stopping=Stopping(step=1e-300))),
        ),
        SgcNdt(
            landmarks=LandmarkFinder(
                segmenter=Segmenter(clusters=ClusterFinder(merge=L2Distance()))
            )
        ),
    ],
)
def test_other_choices_come_back_too(settings, tmp_path):
    write_settings(tmp_path / "settings.toml", settings)
    assert read_settings(tmp_path / "settings.toml") == settings


def test_what_is_left_out_has_its_default():
    assert settings_from_toml('type = "SgcNdt"') == SgcNdt()
    text = 'type = "SgcNdt"\nscore = "p2d"\nspacing = 1\n[schedule.solver]\ntype = "Bfgs"\n'
    found = settings_from_toml(text)
    assert found == SgcNdt(score="p2d", spacing=1.0, schedule=CoarseToFine(solver=Bfgs()))
    assert math.isclose(found.spacing, 1.0)
    assert isinstance(found.spacing, float)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("spacing = ", "mine: not TOML"),
        ("spacing = 1", "mine: type must be one of SgcNdt.*, got None"),
        ('type = "Path"', "type must be one of SgcNdt.*, got 'Path'"),
        ('type = "SgcNdt"\nspacings = 1', "mine: spacings is no setting of SgcNdt; it has score"),
        ('type = "SgcNdt"\nspacing = true', "mine: spacing must be a number, got True"),
        ('type = "SgcNdt"\nspacing = "wide"', "mine: spacing must be a number, got 'wide'"),
        ('type = "SgcNdt"\nspacing = -1', r"mine: spacing must be positive, got -1\.0 m"),
        ('type = "SgcNdt"\nscore = "p3d"', "score must be 'd2d' or 'p2d', got 'p3d'"),
        ('type = "SgcNdt"\nschedule = 3', "schedule must be a table of type CoarseToFine, got 3"),
        (
            'type = "SgcNdt"\n[schedule.solver.stopping]\nstep = 0',
            "schedule.solver: type must be one of Newton",
        ),
        (
            'type = "SgcNdt"\n[[schedule.scales]]\nblur = 1.0',
            r"schedule\.scales\[0\]: Scale needs a value for largest_radius",
        ),
    ],
)
def test_a_mistake_names_its_key_and_the_remedy(text, message):
    with pytest.raises(InvalidInput, match=message):
        settings_from_toml(text, "mine")


def test_bytes_that_are_no_text_are_refused(tmp_path):
    (tmp_path / "x.toml").write_bytes(b"\xff\xfe")
    with pytest.raises(InvalidInput, match="no text in UTF-8"):
        read_settings(tmp_path / "x.toml")
    with pytest.raises(FileNotFoundError):
        read_settings(tmp_path / "y.toml")


def test_a_changed_number_is_the_only_thing_that_changes():
    method = METHODS["sgc-ndt-p2d"]
    lines = [settings_to_toml(one).splitlines() for one in (method, replace(method, spacing=0.25))]
    changed = [pair for pair in zip(*lines, strict=True) if pair[0] != pair[1]]
    assert changed == [("spacing = 0.5", "spacing = 0.25")]
