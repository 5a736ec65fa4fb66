import numpy as np
import pytest

from reference import jackknife as reference
from reference.samples import street, yaw_pose
from scanlock.arrays import read_only
from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import hat, log_rotation
from scanlock.optimisation.objectives.constraints import UNCONSTRAINED, Constraints, PosePrior
from scanlock.optimisation.objectives.point_pairs import PointPairs, plane_precisions
from scanlock.optimisation.solvers.criteria import StopReason
from scanlock.optimisation.solvers.gauss_newton import gauss_newton_step
from scanlock.optimisation.solvers.problem import Objective
from scanlock.optimisation.solvers.solution import Solution
from scanlock.registration.methods.calibration import covariance_factor
from scanlock.registration.methods.ndt_d2d import NdtD2d
from scanlock.registration.prepare import prepare
from scanlock.registration.register import register
from scanlock.registration.registry import METHODS
from scanlock.registration.uncertainty.estimators import CovarianceEstimator

_METHOD = NdtD2d(cell_sizes=(4.0, 2.0))
_MOTION = yaw_pose(0.2, (0.8, -0.3, 0.1))


def _never(start):
    raise AssertionError("no other start is asked for")


def _planes(seed, count=600, deviation=0.05, units=40, at=None):
    """Points on many planes about the sensor: a linear problem, with its exact minimum."""
    layout, rng = np.random.default_rng(0), np.random.default_rng([5, seed])
    middles = layout.uniform(-40.0, 40.0, (units, 3)) // 8.0 * 8.0 + 4.0
    member = np.arange(count) % units
    source = middles[member] + layout.uniform(-1.0, 1.0, (count, 3))
    normals = layout.normal(size=(count, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    target = source + normals * rng.normal(0.0, deviation, count)[:, None]
    pose = Pose.identity() if at is None else at
    rows = read_only(np.arange(count))
    weights = np.full(count, deviation**-2)
    objective = PointPairs(
        target=read_only(pose.apply(target)),
        source=read_only(source),
        target_rows=rows,
        source_rows=rows,
        precisions=read_only(plane_precisions(normals @ pose.rotation.T, weights)),
    )
    return objective, pose


def _solved(objective: Objective, pose: Pose, constraints=UNCONSTRAINED):
    held = constraints.applied_to(objective)
    for _ in range(4):
        pose = pose.retract(gauss_newton_step(held.linearise(pose), 20.0))
    return Solution(pose, held.linearise(pose), StopReason.STEP_SMALL, (), (), held)


def _told(solution, factor=1.0, tilt=1.0, **settings):
    found = CovarianceEstimator(tilt_inflation=tilt, **settings).estimate(solution, factor, _never)
    assert not isinstance(found, str), found
    return found


def test_the_hessian_way_is_the_textbook_of_least_squares():
    objective, start = _planes(1)
    solution = _solved(objective, start)
    pose = solution.pose
    normals = np.sqrt(objective.precisions[:, [0, 3, 5]])
    products = objective.precisions[:, [1, 2]]
    signs = np.where(products < 0.0, -1.0, 1.0)
    normals[:, 1:] *= signs
    moved = pose.apply(objective.source)
    rows = np.column_stack([normals, np.cross(moved, normals)])
    residuals = np.einsum("na,na->n", normals, moved - objective.target)
    variance = residuals @ residuals / (len(rows) - 6)
    step = variance * np.linalg.inv(rows.T @ rows)
    to_place = np.eye(6)
    to_place[:3, 3:] = -hat(pose.translation)
    found, units = _told(solution, way="hessian", floor=1e-9)
    np.testing.assert_allclose(found, to_place @ step @ to_place.T, rtol=1e-6, atol=1e-15)
    assert np.isnan(units)


def test_the_sandwich_is_the_jackknife_over_blocks():
    objective, start = _planes(2)
    solution = _solved(objective, start)
    found, units = _told(solution, floor=1e-9)
    normals = np.sqrt(objective.precisions[:, [0, 3, 5]])
    normals[:, 1:] *= np.where(objective.precisions[:, [1, 2]] < 0.0, -1.0, 1.0)
    moved = solution.pose.apply(objective.source)
    rows = np.column_stack([normals, np.cross(moved, normals)])
    residuals = np.einsum("na,na->n", normals, moved - objective.target)
    expected = np.zeros((6, 6))
    for corner in (0.0, 4.0):
        cubes = np.floor((objective.source + corner) / 8.0)
        _, member = np.unique(cubes, axis=0, return_inverse=True)
        expected += 0.5 * reference.covariance(rows, residuals, np.ones(len(rows)), member.ravel())
    to_place = np.eye(6)
    to_place[:3, 3:] = -hat(solution.pose.translation)
    expected = to_place @ expected @ to_place.T
    # Up to what it allows for few units, alike in all directions of either grid.
    ratio = np.linalg.eigvals(np.linalg.solve(expected, found)).real
    assert ratio.min() > 1.0
    assert ratio.max() < 1.0 + 7.0 / 30.0
    assert 40.0 < units < 150.0


def test_it_foretells_the_errors_of_a_small_problem():
    nees = []
    for seed in range(120):
        objective, start = _planes(seed)
        solution = _solved(objective, start)
        error = np.concatenate([solution.pose.translation, log_rotation(solution.pose.rotation)])
        covariance, _ = _told(solution, floor=1e-9)
        nees.append(error @ np.linalg.solve(covariance, error))
    # Mean 6 by design; the bounds hold 99.9 % of the means of 120 draws of chi-square.
    assert 4.9 < np.mean(nees) < 7.2


def test_it_turns_with_the_target():
    motion = yaw_pose(0.9, (3.0, -7.0, 1.0))
    (still, start), (moved, begun) = _planes(3), _planes(3, at=motion)
    one, _ = _told(_solved(still, start))
    other, _ = _told(_solved(moved, begun))
    turn = np.kron(np.eye(2), motion.rotation)
    np.testing.assert_allclose(other, turn @ one @ turn.T, rtol=1e-6, atol=1e-14)


def test_twice_the_evidence_halves_it():
    few, many = (_solved(*_planes(4, count=count)) for count in (480, 960))
    ratio = np.trace(_told(few)[0][:3, :3]) / np.trace(_told(many)[0][:3, :3])
    assert 1.5 < ratio < 2.6


def test_the_factor_multiplies_deviations():
    solution = _solved(*_planes(5))
    one, three = (_told(solution, factor, floor=1e-9)[0] for factor in (1.0, 3.0))
    np.testing.assert_allclose(three, 9.0 * one, rtol=1e-6, atol=1e-14)


def test_tilts_are_less_sure_wherever_the_source_lies():
    place = Pose(np.eye(3), np.array([4.0, -9.0, 2.0]))
    sensor, rest = (_solved(*_planes(5, at=at)) for at in (Pose.identity(), place))
    one, three = (_told(sensor, tilt=tilt, floor=1e-9)[0] for tilt in (1.0, 3.0))
    np.testing.assert_allclose(three[3:5, 3:5], 9.0 * one[3:5, 3:5], rtol=1e-6)
    np.testing.assert_allclose(_told(rest, tilt=3.0, floor=1e-9)[0], three, rtol=1e-6, atol=1e-14)


def test_a_prior_adds_what_it_knows():
    objective, start = _planes(6)
    free = _told(_solved(objective, start))[0]
    vague = PosePrior.from_deviations(start, 1e3, 1e3)
    np.testing.assert_allclose(
        _told(_solved(objective, start, Constraints(prior=vague)))[0], free, rtol=1e-3, atol=1e-12
    )
    sure = PosePrior.from_deviations(start, 1e-5, 1e-6)
    held = _told(_solved(objective, start, Constraints(prior=sure)), floor=1e-9)[0]
    np.testing.assert_allclose(np.sqrt(np.diag(held)), np.repeat([1e-5, 1e-6], 3), rtol=0.05)


@pytest.mark.parametrize(("dof", "locked"), [("xyz+yaw", [3, 4]), ("xy+yaw", [2, 3, 4])])
@pytest.mark.parametrize("way", ["sandwich", "hessian"])
def test_locked_directions_have_no_variance(dof, locked, way):
    objective, start = _planes(7)
    matrix, _ = _told(_solved(objective, start, Constraints(dof=dof)), way=way)
    free = [row for row in range(6) if row not in locked]
    assert not matrix[locked].any()
    assert not matrix[:, locked].any()
    assert np.linalg.eigvalsh(matrix[np.ix_(free, free)])[0] > 0.0


@pytest.fixture(scope="module")
def scans():
    target, source = street(1, 6000), _MOTION.inverse().apply(street(2, 6000))
    return [prepare(one, method=_METHOD) for one in (source, target)]


@pytest.mark.parametrize("way", ["sandwich", "hessian", "sampled"])
def test_a_registration_tells_how_sure_it_is(scans, way):
    result = register(*scans, initial=_MOTION, covariance=way)
    covariance = result.covariance
    assert covariance is not None
    assert covariance.method == way
    assert np.linalg.eigvalsh(covariance.matrix)[0] > 0.0
    assert 1e-4 < covariance.deviations[:3].max() < 0.1
    assert "covariance" in result.timings
    assert result.as_dict()["covariance"]["matrix"] == covariance.matrix.tolist()
    error = result.target_from_source.translation - _MOTION.translation
    assert error @ np.linalg.solve(covariance.matrix[:3, :3], error) < 30.0


def test_the_sampled_way_is_never_surer(scans):
    within, spread = (
        register(*scans, initial=_MOTION, covariance=way).covariance
        for way in ("sandwich", "sampled")
    )
    assert within is not None
    assert spread is not None
    assert np.linalg.eigvalsh(spread.matrix - within.matrix)[0] > -1e-12


def test_starts_that_end_elsewhere_widen_it():
    solution = _solved(*_planes(8))

    def elsewhere(start):
        # Only starts ahead of the pose or behind it end elsewhere.
        side = np.round((start @ solution.pose.inverse()).translation[0])
        return Solution(
            solution.pose.retract(np.array([2.0 * side, 0.0, 0.0, 0.0, 0.0, 0.0])),
            solution.quadratic, StopReason.STEP_SMALL, (),
        )  # fmt: skip

    found = CovarianceEstimator(method="sampled").estimate(solution, 1.0, elsewhere)
    assert not isinstance(found, str)
    assert np.sqrt(found[0][0, 0]) == pytest.approx(2.0 / np.sqrt(6.0), rel=1e-3)
    assert np.sqrt(found[0][1, 1]) < 0.1


def test_none_is_told_unless_asked_for(scans):
    result = register(*scans, initial=_MOTION)
    assert result.covariance is None
    assert result.as_dict()["covariance"] is None
    assert "covariance" not in result.timings


def test_identical_scans_are_not_exact(scans):
    covariance = register(scans[1], scans[1], covariance="sandwich").covariance
    assert covariance is not None
    assert np.all(covariance.deviations[:3] >= 2.9e-4)
    assert np.linalg.eigvalsh(covariance.matrix)[0] > 0.0


def test_where_nothing_meets_the_notes_say_so(scans):
    far = yaw_pose(0.0, (1e4, 0.0, 0.0))
    result = register(*scans, initial=far, covariance="sandwich")
    assert result.covariance is None
    assert "no covariance: nothing of the scans met" in result.notes


def test_too_few_places_are_said_to_be():
    objective, start = _planes(9)
    found = CovarianceEstimator(min_blocks=2000).estimate(_solved(objective, start), 1.0, _never)
    assert found == "fewer than 2000 separate places of the scene met"


def test_a_direction_that_nothing_holds_is_said_to_be_open():
    objective, _ = _planes(9)
    wall = PointPairs(
        target=objective.target, source=objective.source, target_rows=objective.target_rows,
        source_rows=objective.source_rows,
        precisions=read_only(plane_precisions(np.tile([1.0, 0.0, 0.0], (600, 1)), np.ones(600))),
    )  # fmt: skip
    solution = Solution(
        Pose.identity(), wall.linearise(Pose.identity()), StopReason.STEP_SMALL, (), (), wall
    )
    assert (
        CovarianceEstimator().estimate(solution, 1.0, _never)
        == "the minimum is open along some direction"
    )


def test_an_objective_without_shares_tells_nothing():
    class Whole:
        count = 1

        def linearise(self, pose):
            raise AssertionError

    quadratic = _planes(1)[0].linearise(Pose.identity())
    solution = Solution(Pose.identity(), quadratic, StopReason.STEP_SMALL, (), (), Whole())
    assert "shares" in str(CovarianceEstimator().estimate(solution, 1.0, _never))


@pytest.mark.parametrize(
    "wrong",
    [
        {"way": "guess"},
        {"block": 0.0},
        {"least_block": -1.0},
        {"floor": 0.0},
        {"least_units": 3},
        {"tilt": 0.9},
        {"starts": (0.0, 0.1)},
    ],
)
def test_settings_that_make_no_sense_are_refused(wrong):
    with pytest.raises(InvalidInput, match=next(iter(wrong)).replace("way", "covariance")):
        CovarianceEstimator(**wrong)


def test_an_unknown_way_is_refused_by_register(scans):
    with pytest.raises(InvalidInput, match="covariance must be one of"):
        register(*scans, covariance="guess")  # type: ignore[arg-type]


@pytest.mark.parametrize("name", METHODS)
def test_every_method_has_a_factor_and_a_covariance(name):
    assert 0.5 < covariance_factor(METHODS[name]) < 10.0
    target, source = street(1, 4000), _MOTION.inverse().apply(street(2, 4000))
    result = register(source, target, method=name, initial=_MOTION, covariance="sandwich")
    assert result.covariance is not None, result.notes


def test_settings_never_measured_have_no_factor():
    assert covariance_factor(object()) == 1.0


def test_map_coordinates_speak_about_the_middle_of_the_source():
    offset = np.array([4.5e5, 5.4e6, 100.0])
    target, source = street(1, 6000), _MOTION.inverse().apply(street(2, 6000))
    local = register(source, target, method=_METHOD, initial=_MOTION, covariance="sandwich")
    start = Pose(_MOTION.rotation, offset + _MOTION.translation - _MOTION.rotation @ offset)
    far = register(
        source + offset, target + offset, method=_METHOD, initial=start, covariance="sandwich"
    )
    assert local.covariance is not None
    assert far.covariance is not None
    assert not local.covariance.reference_point.any()
    assert np.linalg.norm(far.covariance.reference_point - offset) < 60.0
    # The cubes lie elsewhere, so not to the last digit.
    ratio = np.diag(far.covariance.at(offset)) / np.diag(local.covariance.at(np.zeros(3)))
    assert np.all((ratio > 0.5) & (ratio < 2.0))


def test_a_covariance_can_be_the_prior_of_the_next_registration(scans):
    first = register(*scans, initial=_MOTION, covariance="sandwich")
    assert first.covariance is not None
    prior = PosePrior(first.target_from_source, first.covariance.matrix)
    second = register(*scans, initial=_MOTION, prior=prior, covariance="sandwich")
    assert second.covariance is not None
    assert np.all(second.covariance.deviations <= 1.01 * first.covariance.deviations)


def _corridor(seed, count=4000):
    """Two walls and a floor, that look alike when shifted along x."""
    rng = np.random.default_rng(seed)
    side, across = rng.integers(3, size=count), rng.uniform(-1.0, 1.0, count)
    y = np.choose(side, (np.full(count, 4.0), np.full(count, -4.0), 4.0 * across))
    z = np.where(side == 2, -1.7, 1.5 * across)
    points = np.column_stack([rng.uniform(-30.0, 30.0, count), y, z])
    return points + rng.normal(0.0, 0.02, points.shape)


def test_samples_show_what_closest_points_hide():
    scans = [prepare(_corridor(seed), method="gicp") for seed in (3, 4)]
    within, spread = (
        register(*scans, initial=yaw_pose(0.01, (0.2, 0.05, 0.0)), covariance=way).covariance
        for way in ("sandwich", "sampled")
    )
    assert within is not None
    assert spread is not None
    # Pairs are held while the pose moves, and hold it where it was.
    assert within.deviations[0] < 0.03
    assert spread.deviations[0] > 0.05
