"""What every entry of METHODS must keep, whatever its formulas."""

import json
import math
import os
import pickle
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import FrozenInstanceError, fields, replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from reference.samples import street, yaw_pose
from scanlock.clouds.point_cloud import PointCloud
from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.registration.methods import DEFAULT_METHOD, METHODS
from scanlock.registration.register import register
from scanlock.registration.result import Registration, Status

pytestmark = pytest.mark.parametrize("method", METHODS)

_TESTS = Path(__file__).resolve().parents[1]
_PYTHONPATH = [path for path in [os.environ.get("PYTHONPATH")] if path]

_MOTION = yaw_pose(0.2, (2.0, -1.0, 0.1))

_METRES, _RADIANS = 0.1, math.radians(0.3)
"""How far a right pose may be from the truth.

Two scans sample a surface at other points and cut it into other polar bins, so the mean of a
part moves between them: by less than the floor of its deviation, 0.1 m, and so does the motion
that a hundred parts agree on. P2D does not end at the truth for perfect scans either: Gaussians
that overlap pull a point between them. Seen from 20 m, 0.1 m are 0.3 degrees.
"""


@cache
def _target():
    return street(1)


@cache
def _source():
    return _MOTION.inverse().apply(street(2))


@cache
def _result(method):
    return register(_source(), _target(), method=method)


def _gap(pose, expected, cloud):
    """How far apart two poses put the points of a cloud, at most [m]."""
    return np.linalg.norm(pose.apply(cloud) - expected.apply(cloud), axis=1).max()


def _report(result):
    """The result as plain values, less the wall times."""
    return {key: value for key, value in result.as_dict().items() if key != "timings_s"}


def test_identical_scans_give_identity(method):
    result = register(_target(), _target(), method=method)
    assert result.status is Status.OK
    assert result.target_from_source.is_close(
        Pose.identity(), translation=_METRES, rotation=_RADIANS
    )
    assert result.overlap == 1.0
    if "d2d" in method:
        # D2D is exactly stationary there.
        assert _gap(result.target_from_source, Pose.identity(), _target()) < 1e-9
        np.testing.assert_allclose(result.score, 1.0, rtol=1e-9)


@pytest.mark.parametrize(
    ("angle", "translation"),
    [(0.2, (2.0, -1.0, 0.1)), (-0.5, (4.0, 3.0, -0.2)), (0.8, (-5.0, 2.0, 0.0)), (0, (8, 0, 0))],
)
def test_a_known_motion_is_recovered(method, angle, translation):
    motion = yaw_pose(angle, translation)
    result = register(motion.inverse().apply(street(2)), _target(), method=method)
    assert result.status is Status.OK
    assert result.target_from_source.is_close(motion, translation=_METRES, rotation=_RADIANS)


def test_a_motion_with_roll_and_pitch_is_recovered(method):
    motion = Pose.from_step(np.array([1.0, -1.0, 0.3, 0.08, -0.05, 0.3]))
    result = register(motion.inverse().apply(street(2)), _target(), method=method)
    assert result.status is Status.OK
    # Without ground, roll and pitch hang on the heights of parts alone.
    assert result.target_from_source.is_close(motion, translation=0.2, rotation=3 * _RADIANS)


@pytest.mark.parametrize(
    ("angle", "translation"), [(0.7, (3.0, 2.0, 0.0)), (2.0, (1.0, 1.0, 0.5)), (0, (0.3, 0.2, 0))]
)
def test_moving_both_scans_moves_the_pose_with_them(method, angle, translation):
    # Polar bins and voxels stay with the axes while the scans move, so parts are cut elsewhere:
    # either pose is as right as the other, and they differ by no more than two right ones.
    common = yaw_pose(angle, translation)
    moved = register(common.apply(_source()), common.apply(_target()), method=method)
    expected = common @ _result(method).target_from_source @ common.inverse()
    assert moved.status is Status.OK
    assert moved.target_from_source.is_close(
        expected, translation=2 * _METRES, rotation=2 * _RADIANS
    )


def test_half_a_turn_of_both_scans_turns_the_pose_exactly(method):
    # Half a turn maps bins onto bins and voxels onto voxels, so only rounding is left, and the
    # solver's stopping step of a micrometre.
    common = yaw_pose(np.pi, (0.0, 0.0, 0.0))
    moved = register(common.apply(_source()), common.apply(_target()), method=method)
    expected = common @ _result(method).target_from_source @ common.inverse()
    assert _gap(moved.target_from_source, expected, _source()) < 1e-5


def test_exchanging_the_scans_inverts_the_pose(method):
    back = register(_target(), _source(), method=method)
    assert back.status is Status.OK
    there_and_back = back.target_from_source @ _result(method).target_from_source
    # P2D has no such symmetry: either way is right by itself.
    metres, radians = (1e-4, 1e-5) if "d2d" in method else (2 * _METRES, 2 * _RADIANS)
    assert there_and_back.is_close(Pose.identity(), translation=metres, rotation=radians)


def test_the_order_of_points_does_not_matter(method):
    rng = np.random.default_rng(3)
    shuffled = register(rng.permutation(_source()), rng.permutation(_target()), method=method)
    # Sums in another order round otherwise, and the solver stops within a micrometre.
    assert shuffled.status is Status.OK
    assert _gap(shuffled.target_from_source, _result(method).target_from_source, _source()) < 1e-5


@pytest.mark.parametrize("far", [[300.0, 0.0, 0.0], [0.0, 0.0, 1e4], [1e6, 1e6, 0.0], [1e12] * 3])
def test_a_point_far_away_changes_nothing(method, far):
    result = register(np.vstack([_source(), far]), np.vstack([far, _target()]), method=method)
    # One more point divides the mean of P2D by one more, so its last step may differ.
    assert result.status is Status.OK
    assert _gap(result.target_from_source, _result(method).target_from_source, _source()) < 1e-5


def test_two_calls_give_the_same_bits(method):
    again = register(_source(), _target(), method=method)
    assert again.target_from_source == _result(method).target_from_source
    assert _report(again) == _report(_result(method))


def test_two_threads_at_once_give_the_same_bits(method):
    def call(_):
        return register(_source(), _target(), method=method)

    with ThreadPoolExecutor(2) as pool:
        for result in pool.map(call, range(4)):
            assert result.target_from_source == _result(method).target_from_source
            assert _report(result) == _report(_result(method))


def test_inputs_are_untouched_and_still_writable(method):
    given = {"source": _source().copy(), "target": _target().copy(), "initial": np.eye(4)}
    before = {name: array.copy() for name, array in given.items()}
    register(**given, method=method)
    for name, array in given.items():
        np.testing.assert_array_equal(array, before[name])
        assert array.flags.writeable
        array += 1.0


def test_read_only_inputs_are_taken_too(method):
    source = _source().copy()
    source.setflags(write=False)
    result = register(source, PointCloud.from_array(_target()), method=method)
    assert result.target_from_source == _result(method).target_from_source


def test_results_survive_a_pickle(method):
    result = _result(method)
    again = pickle.loads(pickle.dumps(result))
    assert isinstance(again, Registration)
    assert again.as_dict() == result.as_dict()
    assert again.target_from_source == result.target_from_source
    assert [entry.pose for entry in again.history] == [entry.pose for entry in result.history]
    assert json.loads(result.to_json()) == result.as_dict()


def test_a_result_tells_how_it_came_about(method):
    result = _result(method)
    assert result.method == method
    assert result.ok
    assert 0.0 <= result.overlap <= 1.0
    assert 0.0 <= result.score <= 1.0
    assert result.iterations == len(result.history) > 1
    total = result.timings["total"]
    assert 0.0 < sum(t for name, t in result.timings.items() if name != "total") <= total
    assert all(np.isfinite(entry.value) for entry in result.history)
    for role in ("target", "source"):
        assert any(note.startswith(f"{role}: ground") for note in result.notes)


def test_rows_that_are_not_finite_are_left_out_and_noted(method):
    spoilt = np.insert(_source(), [0, 700, 6000], [np.nan, np.inf, 0.0], axis=0)
    result = register(spoilt, _target(), method=method)
    assert result.target_from_source == _result(method).target_from_source
    assert "source: 3 rows with NaN or Inf left out" in result.notes


def test_single_precision_costs_no_more_than_its_rounding(method):
    result = register(_source().astype(np.float32), _target().astype(np.float32), method=method)
    # Float32 rounds 35 m to 2 micrometres, and the means of parts by less; no point lies so
    # near the edge of its bin in this scene.
    assert _gap(result.target_from_source, _result(method).target_from_source, _source()) < 2e-5


def _assert_answer_is_local(method, shift, tolerance):
    """Register in map coordinates, and by hand about the origins that the clouds were given."""
    source, target = _source() + shift, _target() + shift
    mapped = register(source, target, method=method)
    clouds = [PointCloud.from_array(scan) for scan in (source, target)]
    between = Pose(np.eye(3), clouds[0].origin - clouds[1].origin)
    local = register(*(cloud.points for cloud in clouds), method=method, initial=between)
    assert local.status is mapped.status is Status.OK
    expected = local.target_from_source.apply(clouds[0].points) + clouds[1].origin
    gaps = np.linalg.norm(mapped.target_from_source.apply(source) - expected, axis=1)
    assert gaps.max() < tolerance
    right = _MOTION.apply(_source()) + shift
    error = np.linalg.norm(mapped.target_from_source.apply(source) - right, axis=1)
    assert np.median(error) < 2 * _METRES
    return mapped


def test_map_coordinates_of_millions_give_the_local_answer(method):
    # Coordinates of millions are rounded to 1e-9 m, and so is the translation of the pose.
    mapped = _assert_answer_is_local(method, np.array([500_000.0, 5_400_000.0, 100.0]), 1e-6)
    assert any("computed about the origin" in note for note in mapped.notes)


@pytest.mark.parametrize("shift", [(500.0, 300.0, 20.0), (5000.0, -4000.0, 100.0)])
def test_map_coordinates_of_kilometres_give_the_local_answer(method, shift):
    _assert_answer_is_local(method, np.array(shift), 1e-6)


def test_an_initial_pose_is_where_the_search_begins(method):
    far = yaw_pose(2.6, (4.0, -3.0, 0.0))
    source = far.inverse().apply(street(2))
    # Two and a half right angles are beyond the basin from the identity.
    assert not register(source, _target(), method=method).ok
    for initial in (far.matrix, far, far.matrix[:3], far.matrix.tolist()):
        result = register(source, _target(), method=method, initial=initial)
        assert result.status is Status.OK
        assert result.history[0].pose.is_close(far, translation=1e-12, rotation=1e-12)
        assert result.target_from_source.is_close(far, translation=_METRES, rotation=_RADIANS)


def test_an_initial_pose_in_map_coordinates_is_one_between_them(method):
    # The clouds lie kilometres apart in the map, so a start about their own origins is another.
    far = yaw_pose(2.6, (4.0, -3.0, 0.0))
    here = Pose(np.eye(3), np.array([500_000.0, 5_400_000.0, 100.0]))
    there = Pose(np.eye(3), np.array([503_000.0, 5_398_000.0, 120.0]))
    truth = here @ far @ there.inverse()
    source = there.apply(far.inverse().apply(street(2)))
    result = register(source, here.apply(_target()), method=method, initial=truth)
    assert result.status is Status.OK
    error = result.target_from_source.apply(source) - truth.apply(source)
    assert np.median(np.linalg.norm(error, axis=1)) < 2 * _METRES


def test_scans_out_of_reach_return_the_initial_pose(method):
    initial = yaw_pose(0.3, (500.0, 20.0, 0.0))
    result = register(_source(), _target(), method=method, initial=initial)
    assert result.status is Status.NO_SUPPORT
    assert result.target_from_source == initial
    assert result.overlap == 0.0


def _heaps(centres):
    rng = np.random.default_rng(0)
    return np.concatenate([c + rng.normal(0.0, 0.05, (30, 3)) for c in np.array(centres)])


def _unlike_heaps():
    """Three heaps a scan that meet when blurred, but not when sharp."""
    target = [[-5.0, -10.0, 0.0], [9.0, -8.0, -1.0], [-3.0, -9.0, -1.0]]
    source = [[2.0, -6.0, 1.0], [-9.0, 13.0, 0.0], [-12.0, 4.0, 1.0]]
    return _heaps(source), _heaps(target)


def test_no_support_always_means_the_initial_pose(method):
    result = register(*_unlike_heaps(), method=method)
    assert not result.ok
    assert (result.target_from_source == Pose.identity()) == (result.status is Status.NO_SUPPORT)


def _ground(seed):
    rng = np.random.default_rng(seed)
    return np.column_stack([rng.uniform(-30, 30, (5000, 2)), rng.normal(-1.7, 0.02, 5000)])


_FEATURELESS = {
    "one point": np.ones((1, 3)),
    "two points": np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]),
    "equal points": np.full((500, 3), 2.5),
    "bare ground": _ground(0),
    "thin noise": np.random.default_rng(1).uniform(-20.0, 20.0, (3000, 3)),
}


@pytest.mark.parametrize("scan", _FEATURELESS)
def test_scans_without_features_return_the_initial_pose(method, scan):
    initial = yaw_pose(0.3, (1.0, 2.0, 0.0))
    featureless = _FEATURELESS[scan]
    for source, target, role in (
        (featureless, _target(), "source"),
        (_source(), featureless, "target"),
        (featureless, featureless, "target"),
    ):
        result = register(source, target, method=method, initial=initial)
        assert result.status is Status.NO_FEATURES
        assert role in result.reason
        assert result.target_from_source == initial
        assert math.isnan(result.overlap)
        assert math.isnan(result.score)
        assert result.as_dict()["score"] is None
        assert result.history == ()


@pytest.mark.parametrize("layout", range(4))
def test_scans_of_other_places_are_not_trusted(method, layout):
    other = street(2, 4000, layout=100 + layout)
    result = register(other, _target(), method=method)
    assert result.status in (Status.LOW_OVERLAP, Status.NOT_CONVERGED, Status.NO_SUPPORT)
    assert np.isfinite(result.target_from_source.matrix).all()


def _corridor(seed, count=6000):
    """What an endless corridor looks like from anywhere in it."""
    rng = np.random.default_rng(seed)
    along = rng.uniform(-40.0, 40.0, count)
    side = rng.choice([-2.0, 2.0], count)
    across, height = side.copy(), rng.uniform(0.0, 3.0, count)
    floor = rng.random(count) < 1 / 3
    across[floor], height[floor] = rng.uniform(-2.0, 2.0, floor.sum()), 0.0
    points = np.column_stack([along, across, height - 1.5])
    return points + rng.normal(0.0, 0.02, points.shape)


def _line(seed):
    rng = np.random.default_rng(seed)
    return np.column_stack([rng.uniform(-10.0, 10.0, 2000), np.full((2000, 2), [5.0, 1.0])])


def _wall(seed):
    rng = np.random.default_rng(seed)
    return np.column_stack(
        [rng.uniform(-10.0, 10.0, 3000), np.full(3000, 8.0), rng.uniform(-1.0, 3.0, 3000)]
    )


@pytest.mark.parametrize("scene", [_corridor, _line, _wall], ids=["corridor", "line", "wall"])
def test_scenes_that_slide_along_themselves_are_not_trusted(method, scene):
    # The scans are alike wherever they were taken: along the scene no pose can be known, so
    # whatever is returned must not be called OK.
    assert register(scene(1), scene(2), method=method).status is not Status.OK


@pytest.mark.parametrize("name", ["corridor", "wall"])
def test_the_direction_along_which_a_scene_slides_is_named(method, name):
    scene = {"corridor": _corridor, "wall": _wall}[name]
    turned = yaw_pose(0.5, (0.0, 0.0, 0.0)).apply(scene(1))
    result = register(turned, turned, method=method)
    assert result.status is Status.DEGENERATE
    x, y, z = (float(part) for part in result.reason.split("(")[1].split(")")[0].split(","))
    # A wall slides along itself any way; the floor of a corridor leaves but one.
    assert abs(y * np.cos(0.5) - x * np.sin(0.5)) < 0.1
    assert name == "wall" or abs(z) < 0.1


def test_poses_are_finite_however_a_registration_ends(method):
    scans = [*_FEATURELESS.values(), _line(1), _wall(1), *_unlike_heaps(), _target()]
    for source in scans:
        result = register(source, _unlike_heaps()[1], method=method)
        assert np.isfinite(result.target_from_source.matrix).all()
        assert json.loads(result.to_json())["status"] == result.status.value


@pytest.mark.parametrize(
    ("scan", "message"),
    [
        (np.empty((0, 3)), "holds no finite point"),
        (np.full((5, 3), np.nan), "holds no finite point"),
        (np.zeros((5, 2)), r"must have shape \(n, 3\)"),
        (np.zeros(3), r"must have shape \(n, 3\)"),
        (np.array([["a", "b", "c"]]), "must hold real numbers"),
    ],
)
def test_what_is_no_scan_is_refused_by_name(method, scan, message):
    with pytest.raises(InvalidInput, match=f"^source {message}"):
        register(scan, _target(), method=method)
    with pytest.raises(InvalidInput, match=f"^target {message}"):
        register(_source(), scan, method=method)


def test_settings_compare_by_value_and_cannot_be_changed(method):
    settings = METHODS[method]
    assert replace(settings) == settings
    assert hash(replace(settings)) == hash(settings)
    assert pickle.loads(pickle.dumps(settings)) == settings
    for field in fields(settings):
        with pytest.raises(FrozenInstanceError):
            setattr(settings, field.name, None)
    assert register(_source(), _target(), method=replace(settings)).target_from_source == (
        _result(method).target_from_source
    )


def test_a_scan_prepared_once_serves_as_target_and_as_source(method):
    settings = METHODS[method]
    target, source = (
        settings.prepare(PointCloud.from_array(scan)) for scan in (_target(), _source())
    )
    forth = settings.align(target, source, Pose.identity())
    assert forth.pose == _result(method).target_from_source
    back = settings.align(source, target, Pose.identity())
    assert (forth.pose @ back.pose).is_close(
        Pose.identity(), translation=2 * _METRES, rotation=2 * _RADIANS
    )


def test_an_unknown_method_is_refused_with_the_names(method):
    assert DEFAULT_METHOD in METHODS
    with pytest.raises(InvalidInput, match=f"{method}.*, got 'icp-of-old'"):
        register(_source(), _target(), method="icp-of-old")


_EVERY_LAYOUT = """
import importlib, pkgutil, sys
import numpy as np
import scanlock, scanlock.kernels
from reference.samples import street

single, double = street(1, 3000).astype(np.float32), street(2, 3000)
wide = np.column_stack([double, np.arange(3000.0)])
frozen = double.copy()
frozen.setflags(write=False)
tilted = double @ np.array([[0.9, 0.0, -0.19**0.5], [0.0, 1.0, 0.0], [0.19**0.5, 0.0, 0.9]])
bare = double[double[:, 2] > -1.0]
layouts = [single, np.asfortranarray(double), wide[::2], frozen, double.tolist(), wide[:, 1:],
           double.astype(">f8"), np.insert(double, 5, np.nan, axis=0), double + 1e6, tilted,
           bare, (100 * double).astype(np.int32)]
for layout in layouts:
    scanlock.segment(layout)
    scanlock.register(layout, double, method=sys.argv[1])
    scanlock.register(double, layout, method=sys.argv[1])
for info in pkgutil.iter_modules(scanlock.kernels.__path__):
    module = importlib.import_module(f"scanlock.kernels.{info.name}")
    for name, value in vars(module).items():
        if hasattr(value, "signatures"):
            print(f"{info.name}.{name}", len(value.signatures))
"""


def test_every_kernel_is_compiled_for_one_signature(method):
    # In a process of its own: here, tests have called kernels with arrays of their own.
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", _EVERY_LAYOUT, method],
        env=os.environ | {"PYTHONPATH": os.pathsep.join([str(_TESTS), *_PYTHONPATH])},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.stderr == ""
    signatures = dict(line.split() for line in done.stdout.splitlines())
    assert set(signatures.values()) <= {"0", "1"}
    used = {"polar.polar_cells", "moments.labelled_moments", "meeting.meeting_gaussians"}
    used |= {"grouping.occupied_cells", "grouping.split_by_extent", "terms.d2d_terms"}
    used |= {"terms.p2d_terms", "tiles.tile_lists"} if "p2d" in method else set()
    assert {signatures[name] for name in used} == {"1"}
