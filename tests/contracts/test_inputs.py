"""Inputs and results of every method."""

import json
import pickle
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from contracts.traits import max_point_distance, report, result, source, target
from scanlock.clouds.point_cloud import PointCloud
from scanlock.errors import InvalidInput
from scanlock.registration.register import register
from scanlock.registration.registry import METHODS
from scanlock.registration.result import RegistrationResult

pytestmark = pytest.mark.parametrize("method", METHODS)


@pytest.mark.slow
def test_two_calls_give_identical_results(method):
    again = register(source=source(method), target=target(), method=method)
    assert again.target_from_source == result(method).target_from_source
    assert report(again) == report(result(method))


@pytest.mark.slow
def test_concurrent_calls_give_identical_results(method):
    def call(_):
        return register(source=source(method), target=target(), method=method)

    with ThreadPoolExecutor(2) as pool:
        for found in pool.map(call, range(4)):
            assert found.target_from_source == result(method).target_from_source
            assert report(found) == report(result(method))


@pytest.mark.slow
def test_inputs_are_unchanged_and_writable(method):
    given = {"source": source(method).copy(), "target": target().copy(), "initial": np.eye(4)}
    before = {name: array.copy() for name, array in given.items()}
    register(**given, method=method)
    for name, array in given.items():
        np.testing.assert_array_equal(array, before[name])
        assert array.flags.writeable
        array += 1.0


@pytest.mark.slow
def test_read_only_inputs_are_accepted(method):
    read_only = source(method).copy()
    read_only.setflags(write=False)
    found = register(source=read_only, target=PointCloud.from_array(target()), method=method)
    assert found.target_from_source == result(method).target_from_source


@pytest.mark.slow
def test_results_can_be_pickled(method):
    found = result(method)
    again = pickle.loads(pickle.dumps(found))
    assert isinstance(again, RegistrationResult)
    assert again.as_dict() == found.as_dict()
    assert again.target_from_source == found.target_from_source
    assert [entry.pose for entry in again.history] == [entry.pose for entry in found.history]
    assert json.loads(found.to_json()) == found.as_dict()


def test_a_result_has_method_history_timings_and_notes(method):
    found = result(method)
    assert found.method == method
    assert found.ok
    assert 0.0 <= found.overlap <= 1.0
    assert 0.0 <= found.score <= 1.0
    assert found.evaluations == len(found.history) > 1
    total = found.timings["total"]
    assert 0.0 < sum(t for name, t in found.timings.items() if name != "total") <= total
    assert all(np.isfinite(entry.value) for entry in found.history)
    for role in ("target", "source"):
        assert any(note.startswith(f"{role}: ground") for note in found.notes)


@pytest.mark.slow
def test_rows_that_are_not_finite_are_dropped_and_noted(method):
    points = np.insert(source(method), [0, 700, 6000], [np.nan, np.inf, 0.0], axis=0)
    found = register(source=points, target=target(), method=method)
    assert found.target_from_source == result(method).target_from_source
    assert "source: 3 rows with NaN or Inf left out" in found.notes


@pytest.mark.slow
def test_single_precision_changes_the_pose_by_its_rounding_only(method):
    found = register(
        source=source(method).astype(np.float32), target=target().astype(np.float32), method=method
    )
    # Float32 rounds 35 m to 2 micrometres, and cluster means by less; no point of this scene is
    # so close to the edge of its bin.
    assert (
        max_point_distance(
            found.target_from_source, result(method).target_from_source, source(method)
        )
        < 2e-5
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scan", "message"),
    [
        (np.empty((0, 3)), "has no finite point"),
        (np.full((5, 3), np.nan), "has no finite point"),
        (np.zeros((5, 2)), r"must have shape \(n, 3\)"),
        (np.zeros(3), r"must have shape \(n, 3\)"),
        (np.array([["a", "b", "c"]]), "must hold real numbers"),
    ],
)
def test_invalid_scans_are_refused_by_name(method, scan, message):
    with pytest.raises(InvalidInput, match=f"^source {message}"):
        register(source=scan, target=target(), method=method)
    with pytest.raises(InvalidInput, match=f"^target {message}"):
        register(source=source(method), target=scan, method=method)
