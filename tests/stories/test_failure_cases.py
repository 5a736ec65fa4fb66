"""Cases of failure detection: their columns, truths and folds."""

import importlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

_ROOT = Path(__file__).resolve().parents[2]

pytestmark = pytest.mark.skipif(not (_ROOT / "benchmarks").is_dir(), reason="needs the benchmarks")


@pytest.fixture
def module(monkeypatch):
    monkeypatch.syspath_prepend(_ROOT)
    return lambda name: importlib.import_module(f"benchmarks.{name}")


@pytest.fixture
def few_beams(monkeypatch, module):
    """Sensors with few firings, so that scans are fast."""
    from scanlock.simulation import SENSORS

    few = {
        name: lambda make=make: replace(make(), azimuth_steps=60) for name, make in SENSORS.items()
    }
    monkeypatch.setattr(module("_common.distortions"), "SENSORS", few)


# An office floor and a room with a symmetry or none, and a bare colonnade.
@pytest.mark.parametrize("seed", [9, 10, 44])
def test_cases_of_a_world_that_repeats_have_the_truth_of_their_kind(seed, module, few_beams):
    cases = list(module("_common.repeating_cases").repeating_cases([seed]))
    again = module("_common.repeating_cases").repeating_cases([seed])
    assert len({case.scene for case in cases}) == 1
    is_bare = seed == 44
    for case, twin in zip(cases, again, strict=True):
        assert case.source.tobytes() == twin.source.tobytes()
        assert case.kind == twin.kind
        assert case.world in case.scene
        assert case.kind.startswith("bare, ") == is_bare
        assert ("auto" in case.methods) == (case.start is None)
        is_wrong = any(word in case.kind for word in ("another", "mirrored"))
        assert not (is_wrong and case.truth is not None)
        if not is_wrong and "scale" not in case.kind:
            assert case.truth is not None
        assert (" and " in case.sensor) == ("two sensors" in case.kind)
    kinds = {case.kind.removeprefix("bare, ") for case in cases}
    assert {"same place, 0% changed", "wrong scale", "mirrored", "two sensors", "rig"} <= kinds
    assert ("another part" in kinds) == (not is_bare)
    assert any("look-alike" in kind for kind in kinds) == (seed != 10)


def test_a_look_alike_start_is_one_period_away(module, few_beams):
    for case in module("_common.repeating_cases").repeating_cases([9]):
        if "look-alike" in case.kind:
            metres, radians = case.start.distance(case.truth)
            assert 2.0 < metres < 6.0
            assert radians < np.radians(3.0)


def test_a_wrong_scale_has_a_truth_only_where_it_displaces_less_than_the_tolerance(module):
    distortions, cases = module("_common.distortions"), module("_common.failure_cases")
    from scanlock.geometry.pose import Pose

    rng = np.random.default_rng(0)
    for size, has_truth in ((2.0, True), (200.0, False)):
        cloud = size * rng.normal(size=(50, 3))
        pair = distortions.ScanPair(
            place=cases.Place("scene", "world", "sensor"),
            target=cloud,
            source=cloud,
            truth=Pose.identity(),
        )
        found = list(distortions.distorted_cases(pair, rng))
        for case in found[:2]:
            ratio = np.linalg.norm(case.source, axis=1) / np.linalg.norm(cloud, axis=1)
            assert 0.0099 < np.abs(ratio - 1.0).max() < 0.0501
            assert np.ptp(ratio) < 1e-9
            assert (case.truth is not None) == has_truth
        for case in found[2:]:
            assert case.truth is None
            np.testing.assert_array_equal(case.source, cloud * [1.0, -1.0, 1.0])


def test_no_model_is_fitted_to_a_kind_that_it_is_evaluated_on(module):
    folds = module("_common.folds")
    sensors = np.array(["a", "b", "c", "a and b", "b and c", "a"])
    found = {fold.name: fold for fold in folds.by_name(sensors)}
    assert found["a"].evaluated.tolist() == [True, False, False, False, False, True]
    assert found["a"].fitted.tolist() == [False, True, True, False, True, False]
    assert found["b and c"].fitted.tolist() == [True, False, False, False, False, True]
    names = dict(folds.single(list(found.values())))
    assert list(names) == ["a", "b", "c", "two kinds"]
    assert names["two kinds"].tolist() == [False, False, False, True, True, False]
    scenes = np.array(["kitti", "simulated street 7", "repeating car_park 12", "kitti"])
    found = {fold.name: fold for fold in folds.by_scene(scenes)}
    assert set(found) == {"kitti", "simulated 2", "repeating 2"}
    assert found["kitti"].fitted.tolist() == [False, True, True, False]
    features, right = np.arange(8.0).reshape(4, 2), np.array([True, False, True, True])
    predicted = folds.predicted(
        features, list(found.values()), lambda at: np.array([right[at].mean() - 0.5, 0.0, 1e-3])
    )
    assert predicted[0] == pytest.approx(1 / (1 + np.exp(-0.001)))
    assert predicted[1] == pytest.approx(1 / (1 + np.exp(-0.503)))
