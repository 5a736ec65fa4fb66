"""Coordinates of tables and of point clouds of other libraries."""

from types import SimpleNamespace

import numpy as np
import pytest

from scanlock.clouds.coordinates import coordinates_of
from scanlock.errors import InvalidInput

_XYZ = np.random.default_rng(0).normal(size=(50, 3))


class _Frame(dict):
    """A table with named columns, as those of pandas and polars."""

    @property
    def columns(self):
        return list(self)

    def __array__(self, dtype=None, copy=None):
        return np.column_stack(list(self.values()))


def _columns(*names):
    return {
        name: _XYZ[:, "xyz".index(name)] if name in "xyz" else np.arange(50.0) for name in names
    }


@pytest.mark.parametrize("names", [("x", "y", "z"), ("i", "x", "y", "z"), ("z", "t", "y", "x")])
@pytest.mark.parametrize("kind", [dict, _Frame])
def test_columns_are_taken_by_name(kind, names):
    np.testing.assert_array_equal(coordinates_of(kind(_columns(*names)), "scan"), _XYZ)


def test_fields_of_a_structured_array_are_taken_by_name():
    array = np.zeros(50, [("intensity", "u1"), ("z", "f4"), ("x", "f4"), ("y", "f4")])
    for axis, name in enumerate("xyz"):
        array[name] = _XYZ[:, axis]
    np.testing.assert_array_equal(coordinates_of(array, "scan"), _XYZ.astype(np.float32))


def test_upper_case_names_are_coordinates_unless_whole_numbers():
    table = {name.upper(): values for name, values in _columns("x", "y", "z").items()}
    np.testing.assert_array_equal(coordinates_of(table, "scan"), _XYZ)
    raw = {name: np.round(1000 * values).astype(np.int32) for name, values in table.items()}
    with pytest.raises(InvalidInput, match=r"scan has X, Y and Z as whole numbers.*las\.xyz"):
        coordinates_of(raw, "scan")


def test_a_table_without_coordinates_is_refused_by_its_names():
    with pytest.raises(InvalidInput, match="columns x, y and z, got easting, northing, height"):
        coordinates_of(dict.fromkeys(("easting", "northing", "height"), np.zeros(4)), "scan")


def test_text_columns_are_refused_by_name():
    table = {**_columns("x", "y"), "z": np.array(["a"] * 50)}
    with pytest.raises(InvalidInput, match=r"scan\['z'\] must be one real number per point"):
        coordinates_of(table, "scan")


def test_numbered_columns_are_taken_by_position():
    class Numbered:
        columns = (0, 1, 2)

        def __getitem__(self, key):
            raise AssertionError("columns without names are not taken by name")

        def __array__(self, dtype=None, copy=None):
            return _XYZ

    np.testing.assert_array_equal(coordinates_of(Numbered(), "scan"), _XYZ)


def test_scaled_coordinates_of_laspy_win_over_its_raw_points():
    raw = np.zeros(50, [("X", "i4"), ("Y", "i4"), ("Z", "i4")])
    las = SimpleNamespace(xyz=_XYZ, points=raw)
    np.testing.assert_array_equal(coordinates_of(las, "scan"), _XYZ)


def test_positions_of_a_tensor_cloud_are_taken():
    tensor = SimpleNamespace(numpy=lambda: _XYZ.astype(np.float32))
    tensor.cpu = lambda: tensor
    cloud = SimpleNamespace(point=SimpleNamespace(positions=tensor))
    np.testing.assert_array_equal(coordinates_of(cloud, "scan"), _XYZ.astype(np.float32))


@pytest.mark.parametrize("attribute", ["points", "vertices"])
def test_points_of_an_object_are_taken(attribute):
    np.testing.assert_array_equal(
        coordinates_of(SimpleNamespace(**{attribute: _XYZ}), "scan"), _XYZ
    )


def test_degrees_are_refused():
    cloud = SimpleNamespace(points=_XYZ, crs=SimpleNamespace(is_geographic=True, name="WGS 84"))
    with pytest.raises(InvalidInput, match=r"scan has longitudes .* degrees \(WGS 84\); project"):
        coordinates_of(cloud, "scan")


def test_a_float64_array_is_not_copied():
    assert coordinates_of(_XYZ, "scan").base is _XYZ


def test_coordinates_as_attributes_are_taken():
    records = SimpleNamespace(x=_XYZ[:, 0], y=_XYZ[:, 1], z=_XYZ[:, 2])
    np.testing.assert_array_equal(coordinates_of(records, "scan"), _XYZ)
