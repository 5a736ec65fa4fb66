import numpy as np
import pytest

from reference import gaussian_scores as reference
from reference.samples import gaussians
from scanlock.arrays import read_only
from scanlock.geometry.pose import Pose
from scanlock.kernels.gaussians.neighbour_lists import (
    centroid_and_distances,
    neighbour_lists,
    sorted_by_cell,
)
from scanlock.optimisation.objectives import neighbour_lists as module
from scanlock.optimisation.objectives.gaussian_scores import GaussiansToGaussians, ScoreShape
from scanlock.optimisation.objectives.neighbour_lists import NeighbourLists, NeighbourSearch
from scanlock.threads import using_threads


class _AllPairs:
    """An association of each source with all targets, at any distance."""

    def __init__(self, targets):
        self._list = np.array([0, targets]), np.arange(targets)

    def at(self, positions):
        return tuple(
            read_only(array) for array in (np.zeros(len(positions), np.int64), *self._list)
        )


def _step(rng, scale=1.0):
    return Pose.from_step(scale * rng.normal(0.0, [5.0, 5.0, 1.0, 1.0, 1.0, 2.0]))


def _pairs(lists):
    """The set of all (source, target) of lists, without repetition."""
    rows, starts, members = lists
    found = [
        (source, int(target))
        for source, row in enumerate(rows)
        if row >= 0
        for target in members[starts[row] : starts[row + 1]]
    ]
    assert len(found) == len(set(found))
    return set(found)


def _all(near):
    """The set of all (source, target) in all chunks."""
    return {
        (near.rows(chunk).start + source, target)
        for chunk in near.chunks
        for source, target in _pairs(near.lists(chunk))
    }


@pytest.mark.parametrize("half_width", [0.0, 5.0, 40.0, 2000.0])
@pytest.mark.parametrize("seed", range(3))
def test_targets_in_range_match_the_definition(seed, half_width):
    rng = np.random.default_rng(seed)
    target, source = (
        gaussians(rng, 90, half_width=half_width, min_deviation=0.2, max_deviation=4.0)
        for _ in range(2)
    )
    pose = _step(rng, 0.1)
    margins = rng.uniform(0.0, 5.0, 90)
    *order, side, columns, rows = sorted_by_cell(target.means, target.max_variances, 3.0)
    ends, members = neighbour_lists(
        *(read_only(array) for array in order), side, columns, rows, target.max_variances.max(),
        source.means, source.max_variances, read_only(margins), pose.rotation,
        pose.translation, 9.0,
    )  # fmt: skip
    positions = pose.apply(source.means)
    squares = ((positions[:, None] - target.means) ** 2).sum(axis=2)
    expected = (
        squares < 9.0 * (source.max_variances[:, None] + target.max_variances) + margins[:, None]
    )
    found = _pairs((np.arange(90), ends, members))
    assert found == set(zip(*(rows.tolist() for rows in np.nonzero(expected)), strict=True))
    assert bool(found) == (half_width < 2000.0)


@pytest.mark.parametrize("side", [0.01, 1.0, 50.0])
def test_sorted_targets_lie_in_their_cells_and_cells_are_limited(side):
    rng = np.random.default_rng(11)
    means = rng.normal(0.0, [30.0, 10.0, 2.0], (500, 3))
    widths = rng.uniform(0.1, 1.0, 500)
    starts, order, inside, corner, used, columns, rows = sorted_by_cell(
        read_only(means), read_only(widths), side
    )
    assert used >= side
    assert max(columns, rows) <= 129
    assert sorted(order.tolist()) == list(range(500))
    np.testing.assert_array_equal(inside, np.column_stack([means, widths])[order].T)
    cells = np.repeat(np.arange(columns * rows), np.diff(starts))
    positions = (inside[:2] - corner[:, None]) / used
    for axis, cell in zip(positions, (cells % columns, cells // columns), strict=True):
        assert ((axis > cell - 1e-9) & (axis < cell + 1 + 1e-9)).all()


@pytest.mark.parametrize("count", [0, 1, 77])
def test_centre_and_arms_match_the_definition(count):
    means = np.random.default_rng(12).normal(40.0, 20.0, (count, 3))
    centre, arms = centroid_and_distances(read_only(means))
    expected = means.mean(axis=0) if count else np.zeros(3)
    np.testing.assert_allclose(centre, expected, rtol=1e-14)
    np.testing.assert_allclose(arms, np.linalg.norm(means - expected, axis=1), atol=1e-12)


def test_the_order_of_sources_changes_no_list():
    # Sources that are close in the order share a query of the grid; scattered ones do not.
    rng = np.random.default_rng(13)
    target, source = (gaussians(rng, 300, half_width=15.0, max_deviation=0.8) for _ in range(2))
    in_order, scattered = np.lexsort(source.means.T), rng.permutation(300)
    pose = _step(rng, 0.1)
    first, second = (
        {
            (rows[i], j)
            for i, j in _all(
                NeighbourLists(NeighbourSearch(target, source.taken(rows), 25.0), pose)
            )
        }
        for rows in (in_order, scattered)
    )
    assert first == second
    assert len(first) > 500


def test_far_poses_and_empty_sets_have_empty_lists():
    rng = np.random.default_rng(5)
    some, none = gaussians(rng, 10, half_width=5.0), gaussians(rng, 0)
    for far in ([1e4, 0.0, 0.0], [0.0, -1e12, 0.0], [0.0, 1e300, 0.0]):
        near = NeighbourLists(NeighbourSearch(some, some, 25.0), Pose(np.eye(3), np.array(far)))
        assert _all(near) == set()
    for pair in ((some, none), (none, some)):
        assert list(NeighbourLists(NeighbourSearch(*pair, 25.0), Pose.identity()).chunks) == []
        both = GaussiansToGaussians(target=pair[0], source=pair[1])
        for _ in range(2):
            assert both.linearise(_step(rng)).value == 0


@pytest.mark.parametrize("half_width", [5.0, 40.0, 2000.0])
@pytest.mark.parametrize("seed", range(3))
def test_pairs_in_range_score_as_all_pairs(seed, half_width):
    rng = np.random.default_rng(seed)
    target, source = (
        gaussians(rng, 90, half_width=half_width, min_deviation=0.2, max_deviation=4.0)
        for _ in range(2)
    )
    pose = _step(rng)
    both = {"target": target, "source": source, "shape": ScoreShape(sharpness=0.5)}
    every = GaussiansToGaussians(**both, candidates=_AllPairs(90)).linearise(pose)
    found = GaussiansToGaussians(**both).linearise(pose)
    expected = reference.d2d_value(pose, target, source, sharpness=0.5)
    for one in (every, found):
        np.testing.assert_allclose(one.value, expected, rtol=1e-11, atol=1e-300)
    scale = np.abs(every.hessian).max()
    np.testing.assert_allclose(found.hessian, every.hessian, rtol=0.0, atol=1e-12 * scale)


def test_round_pairs_up_to_the_end_of_the_window_are_in_range():
    # For round Gaussians the bound is the distance itself: any tighter one fails.
    rng = np.random.default_rng(4)
    target, source = (gaussians(rng, 80, min_deviation=1.0, max_deviation=1.0) for _ in range(2))
    pose = _step(rng, 0.2)
    s = reference.d2d_squared(
        pose, target.means, target.covariances, source.means, source.covariances
    )
    assert ((s > 20.0) & (s < 25.0)).sum() > 50
    within = set(zip(*(rows.tolist() for rows in np.nonzero(s < 25.0)), strict=True))
    assert within <= _all(NeighbourLists(NeighbourSearch(target, source, 25.0), pose))


@pytest.mark.slow
def test_lists_are_valid_until_a_source_may_have_moved_too_far():
    rng = np.random.default_rng(6)
    target, source = (gaussians(rng, 300, half_width=20.0, max_deviation=0.8) for _ in range(2))
    start = _step(rng, 0.1)
    # Away from the origin, so that a rotation about it also moves the centre.
    source = source.transformed(Pose(np.eye(3), np.array([30.0, 0.0, 0.0])))
    near = NeighbourLists(NeighbourSearch(target, source, 25.0), start)
    assert near.are_valid_at(start)
    valid = 0
    for size in np.geomspace(1e-4, 0.5, 40):
        pose = start.retract(size * rng.normal(size=6) * [1, 1, 1, 0.05, 0.05, 0.05])
        moved = np.linalg.norm(pose.apply(source.means) - start.apply(source.means), axis=1).max()
        if near.are_valid_at(pose):
            valid += 1
            assert moved <= np.sqrt(near.search.margins.max())
            s = reference.d2d_squared(
                pose, target.means, target.covariances, source.means, source.covariances
            )
            scored = {(i, j) for i, j in zip(*np.nonzero(s < 25.0), strict=True)}
            assert scored <= _all(near)
    assert 5 < valid < 40


def test_cached_lists_do_not_change_values(monkeypatch):
    rng = np.random.default_rng(7)
    target, source = (gaussians(rng, 200, half_width=15.0, max_deviation=0.8) for _ in range(2))
    made = []

    def counted(*arguments):
        made.append(arguments[1])
        return NeighbourLists(*arguments)

    monkeypatch.setattr("scanlock.optimisation.objectives.gaussian_scores.NeighbourLists", counted)
    both = GaussiansToGaussians(target=target, source=source)
    poses = [_step(rng, 0.05) for _ in range(4)]
    close = [pose.retract(1e-6 * np.ones(6)) for pose in poses]
    values = [both.linearise(pose).value for one in zip(poses, close, strict=True) for pose in one]
    assert len(made) == 4
    fresh = [
        GaussiansToGaussians(target=target, source=source).linearise(pose).value
        for one in zip(poses, close, strict=True)
        for pose in one
    ]
    np.testing.assert_allclose(values, fresh, rtol=1e-12)


def test_lists_beyond_the_cache_limit_are_computed_again(monkeypatch):
    rng = np.random.default_rng(8)
    target, source = (gaussians(rng, 2500, half_width=20.0) for _ in range(2))
    pose = _step(rng, 0.1)
    whole = GaussiansToGaussians(target=target, source=source).linearise(pose)
    monkeypatch.setattr(module, "_MAX_CACHED", 500)
    near = NeighbourLists(NeighbourSearch(target, source, 25.0), pose)
    assert len(near.chunks) == 3
    for chunk in near.chunks:
        again, before = near.lists(chunk), near.lists(chunk)
        assert (again is before) == (chunk == 0)
    assert len(near._cached) == 1
    again = GaussiansToGaussians(target=target, source=source).linearise(pose)
    assert again.value == whole.value
    np.testing.assert_array_equal(again.hessian, whole.hessian)


def test_results_are_bitwise_equal_for_any_number_of_threads():
    rng = np.random.default_rng(10)
    target, source = (gaussians(rng, 3000, half_width=25.0) for _ in range(2))
    found = []
    for count in (1, 2, 3, 7):
        objective = GaussiansToGaussians(target=target, source=source)
        with using_threads(count):
            found.append([objective.linearise(_step(np.random.default_rng(1), 0.1)) for _ in "ab"])
    for first, second in found:
        for one in (first, second):
            assert one.value == found[0][0].value
            np.testing.assert_array_equal(one.hessian, found[0][0].hessian)
