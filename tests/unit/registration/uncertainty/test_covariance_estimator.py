import numpy as np
import pytest

from reference import jackknife as reference
from reference.pairs import register_pair
from reference.samples import street, yaw_pose
from scanlock.arrays import read_only
from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.optimisation.objectives.constraints import UNCONSTRAINED, Constraints, PosePrior
from scanlock.optimisation.objectives.point_pairs import PointPairs, plane_precisions
from scanlock.optimisation.solvers.criteria import StopReason
from scanlock.optimisation.solvers.gauss_newton import gauss_newton_step
from scanlock.optimisation.solvers.problem import Objective
from scanlock.optimisation.solvers.solution import Solution
from scanlock.registration.methods.ndt_d2d import NdtD2d
from scanlock.registration.prepare import prepare
from scanlock.registration.register import register
from scanlock.registration.registry import METHODS
from scanlock.registration.uncertainty.covariance_estimator import CovarianceEstimator
from scanlock.registration.uncertainty.sampling_pattern import SamplingPattern

_METHOD = NdtD2d(cell_sizes=(4.0, 2.0))
_MOTION = yaw_pose(0.2, (0.8, -0.3, 0.1))


def _no_start(start):
    raise AssertionError("no perturbed start is needed")


def _planes(seed, count=600, deviation=0.05, blocks=40, pose=None):
    """Correspondences with planes around the sensor: a linear problem with an exact minimum."""
    layout, rng = np.random.default_rng(0), np.random.default_rng([5, seed])
    centres = layout.uniform(-40.0, 40.0, (blocks, 3)) // 8.0 * 8.0 + 4.0
    labels = np.arange(count) % blocks
    source = centres[labels] + layout.uniform(-1.0, 1.0, (count, 3))
    normals = layout.normal(size=(count, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    target = source + normals * rng.normal(0.0, deviation, count)[:, None]
    pose = pose or Pose.identity()
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
    constrained = constraints.applied_to(objective)
    for _ in range(4):
        pose = pose.retract(gauss_newton_step(constrained.linearise(pose), 20.0))
    at = constrained.linearise(pose)
    return Solution(pose, at, StopReason.STEP_SMALL, (), objective=constrained)


def _linearised(objective, pose):
    """Jacobian and residuals of point-to-plane correspondences, weighted."""
    normals = np.sqrt(objective.precisions[:, [0, 3, 5]])
    normals[:, 1:] *= np.where(objective.precisions[:, [1, 2]] < 0.0, -1.0, 1.0)
    moved = pose.apply(objective.source)
    residuals = np.einsum("na,na->n", normals, moved - objective.target)
    return np.column_stack([normals, np.cross(moved, normals)]), residuals


def _about_source_origin(covariance, pose):
    """The covariance of a step about the target's origin as one about the source's origin."""
    adjoint = Pose(np.eye(3), -pose.translation).adjoint()
    return adjoint @ covariance @ adjoint.T


def _estimated(solution, factor=1.0, roll_pitch_inflation=1.0, **settings):
    estimator = CovarianceEstimator(roll_pitch_inflation=roll_pitch_inflation, **settings)
    estimate = estimator.estimate(solution, factor, _no_start)
    assert not isinstance(estimate, str), estimate
    return estimate


def test_the_hessian_method_is_the_covariance_of_least_squares():
    solution = _solved(*_planes(1))
    jacobian, residuals = _linearised(_planes(1)[0], solution.pose)
    variance = residuals @ residuals / (len(jacobian) - 6)
    step = variance * np.linalg.inv(jacobian.T @ jacobian)
    found, blocks = _estimated(solution, method="hessian", min_deviation=1e-9)
    expected = _about_source_origin(step, solution.pose)
    np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-15)
    assert np.isnan(blocks)


def test_the_sandwich_method_is_the_jackknife_over_blocks():
    objective, start = _planes(2)
    solution = _solved(objective, start)
    found, blocks = _estimated(solution, min_deviation=1e-9)
    jacobian, residuals = _linearised(objective, solution.pose)
    expected, ones = np.zeros((6, 6)), np.ones(len(jacobian))
    for corner in (0.0, 4.0):
        voxels = np.floor((objective.source + corner) / 8.0)
        _, labels = np.unique(voxels, axis=0, return_inverse=True)
        expected += 0.5 * reference.covariance(jacobian, residuals, ones, labels.ravel())
    expected = _about_source_origin(expected, solution.pose)
    # Up to the inflation for few blocks, which is equal in all directions of either grid.
    ratio = np.linalg.eigvals(np.linalg.solve(expected, found)).real
    assert ratio.min() > 1.0
    assert ratio.max() < 1.0 + 7.0 / 30.0
    assert 40.0 < blocks < 150.0


@pytest.mark.slow
def test_the_sandwich_method_is_calibrated_on_a_linear_problem():
    nees = []
    for seed in range(120):
        solution = _solved(*_planes(seed))
        error = solution.pose.log()
        covariance, _ = _estimated(solution, min_deviation=1e-9)
        nees.append(error @ np.linalg.solve(covariance, error))
    # The mean is 6 by design; the bounds hold 99.9 % of the means of 120 draws of chi-square.
    assert 4.9 < np.mean(nees) < 7.2


def test_the_covariance_rotates_with_the_target():
    motion = yaw_pose(0.9, (3.0, -7.0, 1.0))
    one, _ = _estimated(_solved(*_planes(3)))
    other, _ = _estimated(_solved(*_planes(3, pose=motion)))
    rotation = np.kron(np.eye(2), motion.rotation)
    np.testing.assert_allclose(other, rotation @ one @ rotation.T, rtol=1e-6, atol=1e-14)


def test_twice_the_correspondences_halve_the_variance():
    few, many = (_solved(*_planes(4, count=count)) for count in (480, 960))
    ratio = np.trace(_estimated(few)[0][:3, :3]) / np.trace(_estimated(many)[0][:3, :3])
    assert 1.5 < ratio < 2.6


def test_the_factor_scales_the_standard_deviations():
    solution = _solved(*_planes(5))
    one, three = (_estimated(solution, factor, min_deviation=1e-9)[0] for factor in (1.0, 3.0))
    np.testing.assert_allclose(three, 9.0 * one, rtol=1e-6, atol=1e-14)


def test_roll_and_pitch_are_inflated_wherever_the_source_is():
    distant = Pose(np.eye(3), np.array([4.0, -9.0, 2.0]))
    at_origin, away = (_solved(*_planes(5, pose=pose)) for pose in (Pose.identity(), distant))
    one, three = (_estimated(at_origin, 1.0, times, min_deviation=1e-9)[0] for times in (1.0, 3.0))
    np.testing.assert_allclose(three[3:5, 3:5], 9.0 * one[3:5, 3:5], rtol=1e-6)
    found = _estimated(away, 1.0, 3.0, min_deviation=1e-9)[0]
    np.testing.assert_allclose(found, three, rtol=1e-6, atol=1e-14)


_NO_GAPS = SamplingPattern(elevation_gap=0.0, azimuth_gap=0.0)
_GAPS = SamplingPattern(elevation_gap=0.02, azimuth_gap=0.005)


def _with_pattern(solution, pattern, factor=1.0):
    estimate = CovarianceEstimator(min_deviation=1e-9).estimate(
        solution, factor, _no_start, pattern
    )
    assert not isinstance(estimate, str), estimate
    return estimate[0]


def test_a_pattern_without_gaps_adds_nothing_and_replaces_the_inflation():
    solution = _solved(*_planes(5))
    expected, _ = _estimated(solution, 2.0, min_deviation=1e-9)
    found = _with_pattern(solution, _NO_GAPS, 2.0)
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-15)


def test_wider_gaps_increase_the_covariance():
    solution = _solved(*_planes(5))
    wider = SamplingPattern(elevation_gap=0.04, azimuth_gap=0.01)
    none, some, more = (_with_pattern(solution, one) for one in (_NO_GAPS, _GAPS, wider))
    np.testing.assert_allclose(more - none, 4.0 * (some - none), rtol=1e-6, atol=1e-15)
    assert np.linalg.eigvalsh(some - none)[0] > -1e-12
    assert np.trace((some - none)[3:, 3:]) < np.sum([0.02**2, 0.02**2, 0.005**2]) / 12.0


class _Jumping(PointPairs):
    """The same correspondences, as if the value jumped."""

    __slots__ = ()

    @property
    def is_continuous(self):
        return False


def test_a_pose_of_an_objective_that_jumps_follows_the_pattern_whole():
    motion = Pose(np.eye(3), np.array([4.0, -9.0, 2.0]))
    objective, start = _planes(5, pose=motion)
    fields = ("target", "source", "target_rows", "source_rows", "precisions")
    solution = _solved(_Jumping(**{name: getattr(objective, name) for name in fields}), start)
    added = _with_pattern(solution, _GAPS) - _with_pattern(solution, _NO_GAPS)
    # About the source's origin the pattern turns and does not move.
    expected = np.diag([0.0, 0.0, 0.0, 0.02**2, 0.02**2, 0.005**2]) / 12.0
    np.testing.assert_allclose(added, expected, rtol=1e-3, atol=1e-7)


def test_a_strong_prior_leaves_nothing_to_the_pattern():
    objective, start = _planes(6)
    strong = Constraints(prior=PosePrior.from_deviations(start, 1e-5, 1e-6))
    found = _with_pattern(_solved(objective, start, strong), _GAPS)
    np.testing.assert_allclose(np.sqrt(np.diag(found)), np.repeat([1e-5, 1e-6], 3), rtol=0.05)


@pytest.mark.parametrize(("dof", "locked"), [("xyz+yaw", [3, 4]), ("xy+yaw", [2, 3, 4])])
def test_the_pattern_moves_no_locked_direction(dof, locked):
    matrix = _with_pattern(_solved(*_planes(7), Constraints(dof=dof)), _GAPS)
    assert not matrix[locked].any()
    assert matrix[5, 5] > 0.0


def test_a_prior_adds_its_information():
    objective, start = _planes(6)
    free = _estimated(_solved(objective, start))[0]
    weak = Constraints(prior=PosePrior.from_deviations(start, 1e3, 1e3))
    found = _estimated(_solved(objective, start, weak))[0]
    np.testing.assert_allclose(found, free, rtol=1e-3, atol=1e-12)
    strong = Constraints(prior=PosePrior.from_deviations(start, 1e-5, 1e-6))
    found = _estimated(_solved(objective, start, strong), min_deviation=1e-9)[0]
    np.testing.assert_allclose(np.sqrt(np.diag(found)), np.repeat([1e-5, 1e-6], 3), rtol=0.05)


@pytest.mark.parametrize(("dof", "locked"), [("xyz+yaw", [3, 4]), ("xy+yaw", [2, 3, 4])])
@pytest.mark.parametrize("method", ["sandwich", "hessian"])
def test_locked_directions_have_zero_variance(dof, locked, method):
    solution = _solved(*_planes(7), Constraints(dof=dof))
    matrix, _ = _estimated(solution, method=method)
    free = [row for row in range(6) if row not in locked]
    assert not matrix[locked].any()
    assert not matrix[:, locked].any()
    assert np.linalg.eigvalsh(matrix[np.ix_(free, free)])[0] > 0.0


@pytest.fixture(scope="module")
def scans():
    target, source = street(1, 6000), _MOTION.inverse().apply(street(2, 6000))
    return [prepare(one, method=_METHOD) for one in (source, target)]


@pytest.mark.parametrize("method", ["sandwich", "hessian", "sampled"])
def test_a_registration_has_a_covariance_if_asked(scans, method):
    result = register_pair(scans, initial=_MOTION, covariance=method)
    covariance = result.covariance
    assert covariance is not None
    assert covariance.method == method
    assert np.linalg.eigvalsh(covariance.matrix)[0] > 0.0
    assert 1e-4 < covariance.deviations[:3].max() < 0.1
    assert "covariance" in result.timings
    assert result.as_dict()["covariance"]["matrix"] == covariance.matrix.tolist()
    error = result.target_from_source.translation - _MOTION.translation
    assert error @ np.linalg.solve(covariance.matrix[:3, :3], error) < 30.0


def test_the_sampled_covariance_is_never_smaller_than_the_sandwich(scans):
    sandwich, sampled = (
        register_pair(scans, initial=_MOTION, covariance=method).covariance
        for method in ("sandwich", "sampled")
    )
    assert sandwich is not None
    assert sampled is not None
    assert np.linalg.eigvalsh(sampled.matrix - sandwich.matrix)[0] > -1e-12


def test_starts_that_end_elsewhere_increase_the_sampled_covariance():
    solution = _solved(*_planes(8))

    def align(start):
        # Only the starts ahead of the pose and behind it end elsewhere.
        side = np.round((start @ solution.pose.inverse()).translation[0])
        return Solution(
            solution.pose.retract(np.array([2.0 * side, 0.0, 0.0, 0.0, 0.0, 0.0])),
            solution.quadratic, StopReason.STEP_SMALL, (),
        )  # fmt: skip

    estimate = CovarianceEstimator(method="sampled").estimate(solution, 1.0, align)
    assert not isinstance(estimate, str)
    assert np.sqrt(estimate[0][0, 0]) == pytest.approx(2.0 / np.sqrt(6.0), rel=1e-3)
    assert np.sqrt(estimate[0][1, 1]) < 0.1


@pytest.mark.parametrize("covariance", [False, None])
def test_a_registration_can_leave_out_the_covariance(scans, covariance):
    result = register_pair(scans, initial=_MOTION, covariance=covariance)
    assert result.covariance is None
    assert result.accuracy is None
    assert result.as_dict()["covariance"] is None
    assert "covariance" not in result.timings


def test_identical_scans_have_the_minimum_covariance(scans):
    covariance = register(source=scans[1], target=scans[1], covariance="sandwich").covariance
    assert covariance is not None
    assert np.all(covariance.deviations[:3] >= 2.9e-4)
    assert np.linalg.eigvalsh(covariance.matrix)[0] > 0.0


def test_there_is_no_covariance_without_correspondences(scans):
    far = yaw_pose(0.0, (1e4, 0.0, 0.0))
    result = register_pair(scans, initial=far, covariance="sandwich")
    assert result.covariance is None
    assert "no covariance: no correspondences at the pose" in result.notes


def test_there_is_no_covariance_with_too_few_blocks():
    solution = _solved(*_planes(9))
    estimate = CovarianceEstimator(min_blocks=2000).estimate(solution, 1.0, _no_start)
    assert estimate == "fewer than 2000 blocks of the scene have correspondences"


@pytest.mark.parametrize("method", ["sandwich", "hessian"])
def test_there_is_no_covariance_with_an_unconstrained_direction(method):
    objective, pose = _planes(9)
    wall = PointPairs(
        target=objective.target, source=objective.source, target_rows=objective.target_rows,
        source_rows=objective.source_rows,
        precisions=read_only(plane_precisions(np.tile([1.0, 0.0, 0.0], (600, 1)), np.ones(600))),
    )  # fmt: skip
    solution = Solution(pose, wall.linearise(pose), StopReason.STEP_SMALL, (), objective=wall)
    estimate = CovarianceEstimator(method=method).estimate(solution, 1.0, _no_start)
    assert estimate == "the Hessian is singular: some direction is unconstrained"


def test_there_is_no_covariance_of_an_objective_that_is_not_separable():
    class Whole:
        count = 1

        def linearise(self, pose):
            raise AssertionError

    objective, pose = _planes(1)
    quadratic = objective.linearise(pose)
    solution = Solution(pose, quadratic, StopReason.STEP_SMALL, (), objective=Whole())
    assert "not separable" in str(CovarianceEstimator().estimate(solution, 1.0, _no_start))


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("block_size", 0.0),
        ("min_block_size", -1.0),
        ("min_deviation", 0.0),
        ("min_blocks", 3),
        ("roll_pitch_inflation", 0.9),
        ("start_deviations", (0.0, 0.1)),
    ],
)
def test_settings_out_of_range_are_refused(name, value):
    with pytest.raises(InvalidInput, match=name):
        CovarianceEstimator(**{name: value})


def test_an_unknown_method_is_refused(scans):
    with pytest.raises(InvalidInput, match="covariance must be one of"):
        CovarianceEstimator(method="guess")  # type: ignore[arg-type]
    with pytest.raises(InvalidInput, match="covariance must be one of"):
        register_pair(scans, covariance="guess")  # type: ignore[arg-type]


@pytest.mark.slow
@pytest.mark.parametrize("name", METHODS)
def test_every_method_has_a_factor_and_a_covariance(name):
    assert 0.5 < METHODS[name].covariance_factor < 10.0
    target, source = street(1, 4000), _MOTION.inverse().apply(street(2, 4000))
    result = register(
        source=source, target=target, method=name, initial=_MOTION, covariance="sandwich"
    )
    assert result.covariance is not None, result.notes


def test_the_reference_point_of_map_coordinates_is_the_centroid_of_the_source():
    offset = np.array([4.5e5, 5.4e6, 100.0])
    target, source = street(1, 6000), _MOTION.inverse().apply(street(2, 6000))
    local = register(
        source=source, target=target, method=_METHOD, initial=_MOTION, covariance="sandwich"
    )
    start = Pose(_MOTION.rotation, offset + _MOTION.translation - _MOTION.rotation @ offset)
    far = register(
        source=source + offset,
        target=target + offset,
        method=_METHOD,
        initial=start,
        covariance="sandwich",
    )
    assert local.covariance is not None
    assert far.covariance is not None
    assert not local.covariance.reference_point.any()
    assert np.linalg.norm(far.covariance.reference_point - offset) < 60.0
    # The grids of blocks differ, so the covariances agree roughly only.
    sensor = far.covariance.point_covariance(offset)
    ratio = np.diag(sensor) / np.diag(local.covariance.point_covariance(np.zeros(3)))
    assert np.all((ratio > 0.5) & (ratio < 2.0))


def test_a_covariance_can_be_the_prior_of_the_next_registration(scans):
    first = register_pair(scans, initial=_MOTION, covariance="sandwich")
    assert first.covariance is not None
    prior = PosePrior(first.target_from_source, first.covariance.matrix)
    second = register_pair(scans, initial=_MOTION, prior=prior, covariance="sandwich")
    assert second.covariance is not None
    assert np.all(second.covariance.deviations <= 1.01 * first.covariance.deviations)


def _corridor(seed, count=4000):
    """Two walls and a floor along x."""
    rng = np.random.default_rng(seed)
    side, across = rng.integers(3, size=count), rng.uniform(-1.0, 1.0, count)
    y = np.choose(side, (np.full(count, 4.0), np.full(count, -4.0), 4.0 * across))
    z = np.where(side == 2, -1.7, 1.5 * across)
    points = np.column_stack([rng.uniform(-30.0, 30.0, count), y, z])
    return points + rng.normal(0.0, 0.02, points.shape)


@pytest.mark.slow
def test_the_sampled_covariance_is_large_along_a_corridor():
    scans = [prepare(_corridor(seed), method="gicp") for seed in (3, 4)]
    sandwich, sampled = (
        register_pair(scans, initial=yaw_pose(0.01, (0.2, 0.05, 0.0)), covariance=method).covariance
        for method in ("sandwich", "sampled")
    )
    assert sandwich is not None
    assert sampled is not None
    # Nearest neighbours keep the pose along x near its start, which the sandwich cannot see.
    assert sandwich.deviations[0] < 0.03
    assert sampled.deviations[0] > 0.05
