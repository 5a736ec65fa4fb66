import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from scanlock.clouds.point_cloud import PointCloud
from scanlock.errors import InvalidInput

_XYZ = np.random.default_rng(0).integers(-4000, 4000, size=(40, 3)) / 128.0
_UTM = np.array([500_000.0, 5_400_000.0, 312.5])


def _unaligned(array):
    shifted = np.zeros(array.nbytes + 1, np.uint8)
    view = shifted[1:].view(np.float64).reshape(array.shape)
    view[:] = array
    assert not view.flags.aligned
    return view


def _read_only(array):
    array = array.copy()
    array.setflags(write=False)
    return array


@pytest.mark.parametrize(
    "array",
    [
        _XYZ,
        _XYZ.astype(np.float32),
        _XYZ.astype(np.longdouble),
        _XYZ.astype(">f8"),
        _XYZ.tolist(),
        np.asfortranarray(_XYZ),
        np.repeat(_XYZ, 2, axis=0)[::2],
        np.hstack([_XYZ, np.full((40, 2), np.nan)]),
        np.hstack([_XYZ, _XYZ])[:, 3:],
        _read_only(_XYZ),
        _unaligned(_XYZ),
        _XYZ[:, [2, 1, 0]][:, ::-1],
    ],
    ids=[
        "float64",
        "float32",
        "longdouble",
        "big-endian",
        "list",
        "fortran",
        "strided",
        "wide",
        "columns",
        "read-only",
        "unaligned",
        "reversed",
    ],
)
def test_every_layout_becomes_the_same_points(array):
    cloud = PointCloud.from_array(array)
    np.testing.assert_array_equal(cloud.points, _XYZ)
    assert cloud.points.dtype == np.float64
    assert cloud.points.dtype.isnative
    assert cloud.points.flags.c_contiguous
    assert cloud.points.flags.aligned
    assert not cloud.points.flags.writeable
    np.testing.assert_array_equal(cloud.rows, np.arange(40))
    np.testing.assert_array_equal(cloud.origin, [0, 0, 0])
    assert (len(cloud), cloud.input_count, cloud.dropped_count) == (40, 40, 0)


@pytest.mark.parametrize("kind", [np.int8, np.uint16, np.int32, np.int64, np.float16])
def test_integers_and_half_precision_are_converted(kind):
    cloud = PointCloud.from_array(np.arange(12, dtype=kind).reshape(4, 3))
    np.testing.assert_array_equal(cloud.points, np.arange(12.0).reshape(4, 3))


def test_the_input_array_is_not_changed_frozen_or_copied():
    array = _XYZ.copy()
    cloud = PointCloud.from_array(array)
    assert np.shares_memory(cloud.points, array)
    assert array.flags.writeable
    np.testing.assert_array_equal(array, _XYZ)
    with pytest.raises(ValueError, match="read-only"):
        cloud.points[0, 0] = 1.0


@pytest.mark.parametrize("shift", [np.zeros(3), _UTM])
def test_an_input_array_with_invalid_rows_is_not_changed_or_frozen(shift):
    array = _XYZ + shift
    array[3] = np.nan
    before = array.copy()
    PointCloud.from_array(array)
    assert array.flags.writeable
    np.testing.assert_array_equal(array, before)


@pytest.mark.parametrize("kind", [np.float32, np.float64])
def test_rows_that_are_not_finite_are_dropped_and_mapped_back(kind):
    array = _XYZ.astype(kind)
    array[0, 0] = np.nan
    array[7] = np.inf
    array[39, 2] = -np.inf
    cloud = PointCloud.from_array(array)
    kept = np.setdiff1d(np.arange(40), [0, 7, 39])
    np.testing.assert_array_equal(cloud.rows, kept)
    np.testing.assert_array_equal(cloud.points, _XYZ[kept])
    assert (len(cloud), cloud.input_count, cloud.dropped_count) == (37, 40, 3)
    labels = cloud.to_input_rows(np.arange(37), fill=-7)
    np.testing.assert_array_equal(labels[kept], np.arange(37))
    np.testing.assert_array_equal(labels[[0, 7, 39]], [-7, -7, -7])


def test_infinities_that_cancel_are_detected():
    array = _XYZ.copy()
    array[4, 0], array[5, 0] = np.inf, -np.inf
    assert PointCloud.from_array(array).dropped_count == 2


@pytest.mark.parametrize("coordinate", [1e300, -1e308, 1.7e308, 2e12])
def test_coordinates_beyond_the_valid_range_are_dropped(coordinate):
    array = _XYZ.copy()
    array[[2, 9, 30], 1] = coordinate
    cloud = PointCloud.from_array(array)
    np.testing.assert_array_equal(np.setdiff1d(np.arange(40), cloud.rows), [2, 9, 30])
    assert np.isfinite(cloud.points).all()


def test_numbers_too_large_for_float64_are_dropped():
    array = _XYZ.astype(np.longdouble)
    array[2, 0] = np.finfo(np.longdouble).max
    assert PointCloud.from_array(array).dropped_count == int(
        np.finfo(np.longdouble).max > np.finfo(np.float64).max
    )


def test_many_large_but_valid_coordinates_are_kept():
    # Each coordinate is valid, although the sum of their squares is large.
    array = np.full((20, 3), 9e11) + np.arange(20)[:, None]
    cloud = PointCloud.from_array(array)
    assert cloud.dropped_count == 0
    np.testing.assert_array_equal(cloud.points + cloud.origin, array)


@pytest.mark.parametrize(
    ("array", "message"),
    [
        (np.zeros((0, 3)), r"scan has no finite point \(0 rows\)"),
        (np.full((5, 3), np.nan), r"scan has no finite point \(5 rows\)"),
        (np.full((5, 3), 1e308), r"scan has no finite point \(5 rows\)"),
        (np.zeros(3), r"scan must have shape \(n, 3\) or wider, got \(3,\)"),
        (np.zeros((5, 2)), r"scan must have shape \(n, 3\) or wider, got \(5, 2\)"),
        (np.zeros((3, 5, 3)), r"shape \(n, 3\) or wider, got \(3, 5, 3\)"),
        (np.zeros((5, 3), dtype=object), "got dtype object; convert it: .astype"),
        (np.zeros((5, 3), dtype=complex), "scan must hold real numbers, got dtype complex128"),
        (np.zeros((5, 3), dtype=bool), "scan must hold real numbers, got dtype bool"),
        ([["a", "b", "c"]], "scan must hold real numbers, got dtype <U1"),
        ([[1.0, 2.0, 3.0], [4.0]], r"scan must be an \(n, 3\) array"),
        (None, r"scan must be an \(n, 3\) array, got None; scanlock.read_scan reads files"),
        ("a.ply", r"got 'a.ply'; scanlock.read_scan"),
        (Path("a.ply"), r"scanlock.read_scan"),
        (
            np.zeros((3, 64)),
            r"scan must have one point in each row, got shape \(3, 64\); .* scan.T",
        ),
        (
            np.zeros(5, [("x", float), ("y", float)]),
            r"must have columns x, y and z, got x, y; .*np.column_stack",
        ),
    ],
)
def test_invalid_clouds_are_rejected_by_name(array, message):
    with pytest.raises(InvalidInput, match=message):
        PointCloud.from_array(array, name="scan")


def test_a_cloud_is_returned_unchanged():
    cloud = PointCloud.from_array(_XYZ)
    assert PointCloud.from_array(cloud) is cloud


def test_one_point_is_a_cloud():
    assert len(PointCloud.from_array([[1, 2, 3]])) == 1


def test_sensor_coordinates_keep_the_sensor_as_origin():
    # Few points beyond the threshold, as in a long corridor, do not move the origin.
    array = np.vstack([_XYZ, [[50_000.0, 0.0, 0.0]]])
    np.testing.assert_array_equal(PointCloud.from_array(array).origin, [0, 0, 0])


def test_projected_coordinates_keep_their_accuracy():
    array = _XYZ + _UTM + 1e-7
    cloud = PointCloud.from_array(array)
    assert np.abs(cloud.points).max() < 200.0
    np.testing.assert_array_equal(cloud.origin, np.round(cloud.origin))
    distances = np.linalg.norm(cloud.points - cloud.points[0], axis=1)
    expected = np.linalg.norm(_XYZ - _XYZ[0], axis=1)
    assert np.abs(distances - expected).max() < 1e-8
    assert np.abs(cloud.points + cloud.origin - array).max() < 1e-9


def test_outliers_among_projected_coordinates_do_not_move_the_origin():
    array = _XYZ + _UTM
    array[::10] = [1e11, -1e11, 0.0]
    cloud = PointCloud.from_array(array)
    assert np.abs(cloud.origin - _UTM).max() < 40


def test_a_pickled_cloud_is_read_only_again():
    array = _XYZ + _UTM
    array[1] = np.nan
    cloud = PointCloud.from_array(array)
    twin = pickle.loads(pickle.dumps(cloud))
    for name in ("points", "origin", "rows"):
        np.testing.assert_array_equal(getattr(twin, name), getattr(cloud, name))
        assert not getattr(twin, name).flags.writeable
    assert twin.input_count == 40


def test_points_at_zero_of_a_sensor_frame_are_not_measured():
    points = np.array([[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-0.0, 0.0, 0.0], [3.0, 0.0, 2.0]])
    assert PointCloud.from_array(points).is_measured.tolist() == [False, True, False, True]
    # The origin of a recentred cloud is a valid position.
    offset = np.array([5e5, 5e6, 0.0])
    around = np.concatenate([points, -points]) + offset
    cloud = PointCloud.from_array(around)
    assert (cloud.points == 0.0).all(axis=1).any()
    assert cloud.is_measured.all()


def test_masked_coordinates_count_as_not_finite():
    points = np.arange(60.0).reshape(20, 3)
    mask = np.zeros((20, 3), np.bool_)
    mask[[3, 7], [0, 2]] = True
    for kind in (np.float64, np.float32, np.int32):
        cloud = PointCloud.from_array(np.ma.array(points.astype(kind), mask=mask))
        assert cloud.dropped_count == 2
        np.testing.assert_array_equal(cloud.points, np.delete(points, [3, 7], axis=0))


@pytest.mark.parametrize(("kind", "expected"), [(np.float64, 2**-30), (np.float32, 0.5)])
def test_the_rounding_of_projected_coordinates_is_estimated(kind, expected):
    rng = np.random.default_rng(0)
    far = (rng.uniform(-30.0, 30.0, (900, 3)) + np.array([5e5, 5.4e6, 0.0])).astype(kind)
    # Single precision that was converted to double is recognised too.
    assert PointCloud.from_array(far.astype(np.float64)).rounding == expected
    assert PointCloud.from_array(far).rounding == expected
    assert PointCloud.from_array(far - far[0]).rounding == 0.0


def test_the_centroid_is_the_mean_in_input_coordinates():
    points = np.random.default_rng(0).uniform(-30.0, 30.0, (900, 3)) + np.array([5e5, 5.4e6, 0.0])
    cloud = PointCloud.from_array(points)
    np.testing.assert_allclose(cloud.centroid, points.mean(axis=0), atol=1e-6)
    assert not cloud.centroid.flags.writeable
    assert cloud.radius == pytest.approx(PointCloud.from_array(points - points[0]).radius)


class _OtherCloud:
    """Stand-in for the point clouds of other libraries, such as Open3D."""

    def __init__(self, points):
        self.points = points


class _Convertible:
    """Stand-in for a vector type that NumPy converts, such as Open3D's Vector3dVector."""

    def __init__(self, array):
        self._array = array

    def __array__(self, dtype=None, copy=None):
        return np.array(self._array, dtype)


@pytest.mark.parametrize("points", [_XYZ, _XYZ.tolist(), _Convertible(_XYZ)], ids=type)
def test_an_object_with_points_is_accepted(points):
    np.testing.assert_array_equal(PointCloud.from_array(_OtherCloud(points)).points, _XYZ)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (_OtherCloud(np.zeros((5, 2))), r"scan.points must have shape \(n, 3\) or wider, got"),
        (_OtherCloud(object()), r"scan.points must be an \(n, 3\) array, .* got object; convert"),
        (_OtherCloud(None), "scan must be an .* object with points, got _OtherCloud; convert it"),
        (object(), r"scan must be an \(n, 3\) array, .* object with points, got object"),
    ],
)
def test_an_object_without_valid_points_is_rejected_by_name(given, message):
    with pytest.raises(InvalidInput, match=message):
        PointCloud.from_array(given, name="scan")


@pytest.mark.slow
def test_memory_settings_change_with_the_first_cloud_and_not_on_import():
    code = """
from scanlock.clouds import memory
calls = []
memory.keep_freed_memory = lambda: calls.append(1)
from scanlock.clouds.point_cloud import PointCloud
counts = [len(calls)]
for _ in range(2):
    PointCloud.from_array([[1.0, 2.0, 3.0]])
    counts.append(len(calls))
print(counts)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[0, 1, 1]\n"
