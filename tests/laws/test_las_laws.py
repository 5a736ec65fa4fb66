"""LAS files written unchanged are equal, whatever their scales, offsets and units."""

import dataclasses

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from scanlock.io import read_scan, write_scan

laspy = pytest.importorskip("laspy")

_SCALES = st.sampled_from([1.0, 0.01, 0.001, 0.00025, 1e-4, 0.0032808])
_OFFSETS = st.floats(-1e7, 1e7).map(lambda value: round(value, 2) + 0.0)
_INTEGERS = st.integers(-(2**31), 2**31 - 1)
_UNITS = st.sampled_from(["1", "0.3048", "0.3048006096012192", "0.001"])


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("las")


@given(
    scales=st.tuples(_SCALES, _SCALES, _SCALES),
    offsets=st.tuples(_OFFSETS, _OFFSETS, _OFFSETS),
    integers=st.lists(st.tuples(_INTEGERS, _INTEGERS, _INTEGERS), min_size=1, max_size=5),
    units=st.tuples(_UNITS, _UNITS),
)
@settings(max_examples=60, deadline=None)
def test_a_las_file_written_unchanged_is_equal(folder, scales, offsets, integers, units):
    header = laspy.LasHeader(version="1.4", point_format=6)
    header.scales, header.offsets = np.array(scales), np.array(offsets)
    header.global_encoding.wkt = True
    wkt = f'COMPD_CS["a",PROJCS["b",UNIT["u",{units[0]}]],VERT_CS["c",UNIT["v",{units[1]}]]]'
    header.vlrs.append(laspy.VLR("LASF_Projection", 2112, "", wkt.encode()))
    las = laspy.LasData(header)
    las.X, las.Y, las.Z = np.array(integers, np.int32).T
    las.write(folder / "a.las")
    scan = read_scan(folder / "a.las")
    write_scan(folder / "b.las", scan)
    after = laspy.read(folder / "b.las")
    assert np.stack([after.X, after.Y, after.Z], axis=1).tolist() == [list(row) for row in integers]
    assert (list(after.header.scales), list(after.header.offsets)) == (list(scales), list(offsets))
    assert after.header.vlrs[0].string == wkt


@example(coordinates=[(0.005, 1.0, 2.0)], scale=1.0)
@given(
    coordinates=st.lists(st.tuples(*[st.floats(-1e8, 1e8)] * 3), min_size=1, max_size=5),
    scale=_SCALES,
)
@settings(max_examples=60, deadline=None)
def test_moved_points_are_rounded_to_a_tenth_of_a_millimetre_where_32_bits_allow(
    folder, coordinates, scale
):
    points = np.array(coordinates)
    header = laspy.LasHeader(version="1.2", point_format=0)
    header.scales = np.full(3, scale)
    las = laspy.LasData(header)
    las.X = las.Y = las.Z = np.zeros(len(points), np.int32)
    las.write(folder / "c.las")
    scan = dataclasses.replace(read_scan(folder / "c.las"), points=points)
    write_scan(folder / "d.las", scan)
    error = np.abs(read_scan(folder / "d.las").points - points).max(axis=0)
    extent = np.ptp(points, axis=0)
    # Ten times the finest step that 32 bits allow, for steps are divided by ten.
    allowed = np.maximum(0.5e-4, 5.0 * (extent + 1.0) / (2**31 - 1))
    assert (error <= allowed + 1e-7).all()
