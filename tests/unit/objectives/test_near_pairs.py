import numpy as np
import pytest

from reference import gaussian_scores as reference
from reference.samples import gaussians
from scanlock.arrays import read_only
from scanlock.geometry.pose import Pose
from scanlock.kernels.reach import targets_in_reach
from scanlock.objectives import near_pairs as module
from scanlock.objectives.candidates import EveryTarget
from scanlock.objectives.gaussian_scores import GaussiansToGaussians, ScoreShape
from scanlock.objectives.near_pairs import near_pairs


def _step(rng, scale=1.0):
    return Pose.from_step(scale * rng.normal(0.0, [5.0, 5.0, 1.0, 1.0, 1.0, 2.0]))


def _pairs(lists):
    """The set of all (source, target) of lists, each of which must come once."""
    rows, starts, members = lists
    found = [
        (source, int(target))
        for source, row in enumerate(rows)
        if row >= 0
        for target in members[starts[row] : starts[row + 1]]
    ]
    assert len(found) == len(set(found))
    return set(found)


@pytest.mark.parametrize("spread", [0.0, 5.0, 40.0, 2000.0])
@pytest.mark.parametrize("seed", range(3))
def test_targets_in_reach_are_those_of_the_definition(seed, spread):
    rng = np.random.default_rng(seed)
    target, source = (gaussians(rng, 90, spread=spread, least=0.2, most=4.0) for _ in range(2))
    starts, members = targets_in_reach(
        target.means, target.widths, source.means, source.widths, 9.0, 2.5, 0, 10**9
    )
    squares = ((source.means[:, None] - target.means) ** 2).sum(axis=2)
    expected = squares < 9.0 * (source.widths[:, None] + target.widths) + 2.5
    found = _pairs((np.arange(90), starts, members))
    assert found == set(zip(*(rows.tolist() for rows in np.nonzero(expected)), strict=True))
    assert bool(found) == (spread < 2000.0)


def test_listing_by_parts_gives_the_same_lists():
    rng = np.random.default_rng(3)
    target, source = (gaussians(rng, 60, spread=8.0) for _ in range(2))
    sides = target.means, target.widths, source.means, source.widths
    starts, members = targets_in_reach(*sides, 25.0, 0.0, 0, 10**9)
    first = parts = 0
    while first < 60:
        own_starts, own = targets_in_reach(*sides, 25.0, 0.0, first, 100)
        done = first + len(own_starts) - 1
        np.testing.assert_array_equal(own, members[starts[first] : starts[done]])
        np.testing.assert_array_equal(own_starts, starts[first : done + 1] - starts[first])
        first, parts = done, parts + 1
    assert parts > 3


def test_far_places_and_empty_sets_have_nothing_in_reach():
    rng = np.random.default_rng(5)
    some, none = gaussians(rng, 10, spread=5.0), gaussians(rng, 0)
    far = read_only(np.array([[1e4, 0.0, 0.0], [0.0, -1e12, 0.0], [0.0, 1e300, 0.0]]))
    starts, members = targets_in_reach(
        some.means, some.widths, far, some.widths[:3], 25.0, 0.0, 0, 10**9
    )
    assert starts.tolist() == [0, 0, 0, 0]
    assert len(members) == 0
    for pair in ((some, none), (none, some)):
        assert list(near_pairs(*pair, Pose.identity(), 25.0)) == []
        assert GaussiansToGaussians(target=pair[0], source=pair[1]).linearise(_step(rng)).value == 0


@pytest.mark.parametrize("spread", [5.0, 40.0, 2000.0])
@pytest.mark.parametrize("seed", range(3))
def test_pairs_in_reach_score_as_all_of_them_do(seed, spread):
    rng = np.random.default_rng(seed)
    target, source = (gaussians(rng, 90, spread=spread, least=0.2, most=4.0) for _ in range(2))
    pose = _step(rng)
    both = {"target": target, "source": source, "shape": ScoreShape(sharpness=0.5)}
    every = GaussiansToGaussians(**both, candidates=EveryTarget()).linearise(pose)
    found = GaussiansToGaussians(**both).linearise(pose)
    expected = reference.d2d_value(pose, target, source, sharpness=0.5)
    for one in (every, found):
        np.testing.assert_allclose(one.value, expected, rtol=1e-11, atol=1e-300)
    scale = np.abs(every.hessian).max()
    np.testing.assert_allclose(found.hessian, every.hessian, rtol=0.0, atol=1e-12 * scale)


def test_round_pairs_up_to_the_end_of_the_window_are_in_reach():
    # Where all Gaussians are round the bound is the distance itself: any tighter one shows.
    rng = np.random.default_rng(4)
    target, source = (gaussians(rng, 80, least=1.0, most=1.0) for _ in range(2))
    pose = _step(rng, 0.2)
    s = reference.d2d_squared(
        pose, target.means, target.covariances, source.means, source.covariances
    )
    assert ((s > 20.0) & (s < 25.0)).sum() > 50
    [near] = near_pairs(target, source, pose, 25.0)
    within = set(zip(*(rows.tolist() for rows in np.nonzero(s < 25.0)), strict=True))
    assert within <= _pairs(near.lists)


def test_lists_hold_until_something_may_have_moved_too_far():
    rng = np.random.default_rng(6)
    target, source = (gaussians(rng, 300, spread=20.0, most=0.8) for _ in range(2))
    start = _step(rng, 0.1)
    [near] = near_pairs(target, source, start, 25.0)
    assert near.hold_at(start)
    held = 0
    for size in np.geomspace(1e-4, 0.5, 40):
        pose = start.retract(size * rng.normal(size=6) * [1, 1, 1, 0.05, 0.05, 0.05])
        moved = np.linalg.norm(pose.apply(source.means) - start.apply(source.means), axis=1).max()
        if near.hold_at(pose):
            held += 1
            assert moved <= near.slack
            s = reference.d2d_squared(
                pose, target.means, target.covariances, source.means, source.covariances
            )
            scored = {(i, j) for i, j in zip(*np.nonzero(s < 25.0), strict=True)}
            assert scored <= _pairs(near.lists)
    assert 5 < held < 40


def test_an_objective_keeps_its_lists_and_its_values(monkeypatch):
    rng = np.random.default_rng(7)
    target, source = (gaussians(rng, 200, spread=15.0, most=0.8) for _ in range(2))
    made = []

    def counted(*arguments):
        made.append(arguments[2])
        return near_pairs(*arguments)

    monkeypatch.setattr("scanlock.objectives.gaussian_scores.near_pairs", counted)
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


def test_too_many_pairs_are_listed_by_parts(monkeypatch):
    rng = np.random.default_rng(8)
    target, source = (gaussians(rng, 120, spread=6.0) for _ in range(2))
    pose = _step(rng, 0.1)
    whole = GaussiansToGaussians(target=target, source=source).linearise(pose)
    monkeypatch.setattr(module, "_MOST_KEPT", 500)
    assert len(list(near_pairs(target, source, pose, 25.0))) > 3
    objective = GaussiansToGaussians(target=target, source=source)
    for _ in range(2):
        parts = objective.linearise(pose)
        np.testing.assert_allclose(parts.value, whole.value, rtol=1e-12)
        np.testing.assert_allclose(parts.gradient, whole.gradient, atol=1e-10)
