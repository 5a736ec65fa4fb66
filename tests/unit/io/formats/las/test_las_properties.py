import dataclasses
import struct

import numpy as np
import pytest

from scanlock.errors import InvalidInput
from scanlock.io import CoordinateSystem, ScanFile, read_scan, write_scan

laspy = pytest.importorskip("laspy")

_US_FOOT = 1200 / 3937
_RNG = np.random.default_rng(5)
_CORNER = np.array([1_312_345.0, 5_403_210.0, 120.0])
_RAW = _CORNER + np.round(_RNG.random((300, 3)) * 200, 2)
_WKT = (
    'COMPD_CS["site",PROJCS["flat",UNIT["US survey foot",0.304800609601219],'
    'AUTHORITY["EPSG","2269"]],VERT_CS["up",UNIT["metre",1],AUTHORITY["EPSG","5703"]]]'
)


def _geo_keys(**keys):
    """Return a record of GeoTIFF keys, as ``k3076=9002``."""
    rows = [(int(key[1:]), 0, 1, value) for key, value in sorted(keys.items())]
    data = struct.pack("<4H", 1, 1, 0, len(rows)) + b"".join(struct.pack("<4H", *r) for r in rows)
    return laspy.VLR("LASF_Projection", 34735, "keys", data)


def _wkt(text):
    return laspy.VLR("LASF_Projection", 2112, "", text.encode() + b"\0")


def _las(path, *records, version="1.2", point_format=1, points=_RAW, extra=(), wkt_bit=False):
    header = laspy.LasHeader(version=version, point_format=point_format)
    header.scales, header.offsets = [0.01] * 3, [0.0, 5e6 if points is _RAW else 0.0, 0.0]
    header.system_identifier = "RIEGL VQ-780"
    header.file_source_id = 42
    header.global_encoding.value = 1 | (16 if wkt_bit else 0)
    header.vlrs.extend(records)
    for one in extra:
        header.add_extra_dim(one)
    las = laspy.LasData(header)
    las.x, las.y, las.z = points.T
    las.classification = np.arange(len(points)) % 5
    las.gps_time = np.linspace(1e8, 2e8, len(points))
    las.write(path)
    return path


@pytest.mark.parametrize(
    ("keys", "epsg", "metres"),
    [
        ({"k1024": 1, "k3072": 32633, "k3076": 9001}, 32633, (1, 1, 1)),
        ({"k3072": 32633}, 32633, (1, 1, 1)),
        ({"k3072": 2994, "k3076": 9002}, 2994, (0.3048,) * 3),
        ({"k3072": 2269, "k3076": 9003, "k4099": 9001}, 2269, (_US_FOOT, _US_FOOT, 1)),
        ({"k3072": 2269, "k3076": 9002, "k4096": 6360}, 2269, (0.3048, 0.3048, _US_FOOT)),
        ({"k3072": 32767, "k3076": 9003}, None, (_US_FOOT,) * 3),
        ({"k3072": 2994}, 2994, (0.3048,) * 3),
        ({"k1024": 1}, None, (1, 1, 1)),
    ],
)
def test_geo_keys_give_code_and_unit(tmp_path, keys, epsg, metres):
    scan = read_scan(_las(tmp_path / "a.las", _geo_keys(**keys)))
    assert scan.crs.epsg == epsg
    assert scan.crs.metres_per_unit == scan.metres_per_unit == metres
    assert np.abs(scan.points - _RAW * metres).max() < 1e-6
    assert any("converted to metres" in note for note in scan.notes) == (metres != (1, 1, 1))


def test_a_unit_that_is_not_stated_is_noted(tmp_path):
    scan = read_scan(_las(tmp_path / "a.las", _geo_keys(k1024=1)))
    assert scan.crs.horizontal_unit == "unknown"
    assert "does not state the unit: taken as metres" in scan.notes[0]


def test_a_user_defined_unit_is_read_from_its_size(tmp_path):
    rows = [(3072, 0, 1, 32767), (3076, 0, 1, 32767), (3077, 34736, 1, 1)]
    keys = laspy.VLR("LASF_Projection", 34735, "", struct.pack("<16H", 1, 1, 0, 3, *sum(rows, ())))
    sizes = laspy.VLR("LASF_Projection", 34736, "", struct.pack("<2d", 7.0, 0.3048006096))
    scan = read_scan(_las(tmp_path / "a.las", keys, sizes))
    assert scan.crs.horizontal_unit == "US survey foot"


def test_wkt_and_geo_keys_that_differ_are_noted(tmp_path):
    records = _geo_keys(k3072=2994, k3076=9002), _wkt(_WKT)
    by_keys = read_scan(_las(tmp_path / "a.las", *records))
    by_wkt = read_scan(_las(tmp_path / "b.las", *records, version="1.4", wkt_bit=True))
    assert (by_keys.crs.epsg, by_keys.crs.metres_per_unit[0]) == (2994, 0.3048)
    assert (by_wkt.crs.epsg, by_wkt.crs.metres_per_unit[0]) == (2269, _US_FOOT)
    assert "x and y differ: foot by GeoTIFF keys (used), US survey foot by WKT" in by_keys.notes[0]
    # The keys state no vertical system.
    assert by_keys.crs.vertical_epsg == 5703
    assert by_keys.crs.metres_per_unit[2] == 1.0


def test_unreadable_wkt_is_a_note(tmp_path):
    scan = read_scan(_las(tmp_path / "a.las", _wkt("PROJCS["), version="1.4"))
    assert "unreadable" in scan.notes[0]
    assert scan.crs.metres_per_unit == (1, 1, 1)


def test_degrees_stay_degrees(tmp_path):
    points = np.array([[11.5, 48.1, 500.0], [11.6, 48.2, 510.0]])
    path = _las(tmp_path / "a.las", _geo_keys(k1024=2, k2048=4326, k4099=9002), points=points)
    scan = read_scan(path)
    assert (scan.crs.is_geographic, scan.crs.epsg) == (True, 4326)
    assert np.allclose(scan.points, points * [1, 1, 0.3048], atol=1e-9)
    assert "longitude and latitude in degrees" in scan.notes[-1]
    with pytest.raises(InvalidInput, match="scale must not be given for degrees"):
        read_scan(path, scale=0.5)


def _header_facts(path):
    with laspy.open(path) as file:
        header = file.header
        records = [
            (one.user_id, one.record_id, one.record_data_bytes(), extended)
            for extended, group in ((False, header.vlrs), (True, file.evlrs or ()))
            for one in group
        ]
        return {
            "version": str(header.version),
            "format": header.point_format.id,
            "scales": list(header.scales),
            "offsets": list(header.offsets),
            "encoding": header.global_encoding.value,
            "system": header.system_identifier,
            "source": header.file_source_id,
            "guid": header.uuid,
            "box": [*header.mins, *header.maxs],
            "returns": list(header.number_of_points_by_return),
            "records": sorted(records),
        }


_EXTRA = (
    laspy.ExtraBytesParams("amplitude", np.int16, "dB", scales=[0.01], offsets=[3.0]),
    laspy.ExtraBytesParams("tree", np.uint32, "number"),
    laspy.ExtraBytesParams("normal", "3f4", "unit vector"),
)


@pytest.mark.parametrize("ending", ["las", "laz"])
@pytest.mark.parametrize(
    ("version", "point_format", "records"),
    [
        ("1.2", 1, (_geo_keys(k3072=2994, k3076=9002),)),
        ("1.3", 3, (_geo_keys(k3072=32633, k3076=9001), laspy.VLR("me", 7, "mine", b"abc"))),
        ("1.4", 6, (_wkt(_WKT),)),
        ("1.4", 1, ()),
    ],
)
def test_a_file_written_unchanged_is_equal(tmp_path, ending, version, point_format, records):
    path, again = tmp_path / f"a.{ending}", tmp_path / f"b.{ending}"
    wkt = point_format == 6
    _las(
        path, *records, version=version, point_format=point_format, extra=_EXTRA, wkt_bit=wkt
    )  # fmt: skip
    las = laspy.read(path)
    las.amplitude = np.round(_RNG.random(300) * 100, 2)
    las.normal = _RNG.random((300, 3))
    if version == "1.4":
        las.evlrs = laspy.vlrs.vlrlist.VLRList([laspy.VLR("me", 8, "far", bytes(70_000))])
    las.write(path)
    scan = read_scan(path)
    write_scan(again, scan)
    assert _header_facts(again) == _header_facts(path)
    after = read_scan(again)
    assert np.array_equal(after.points, scan.points)
    assert list(after.fields) == list(scan.fields)
    for name, values in scan.fields.items():
        assert np.array_equal(after.fields[name], values)
        assert after.fields[name].dtype == values.dtype
    assert after.crs == scan.crs
    assert dataclasses.replace(after.las, software="") == dataclasses.replace(scan.las, software="")
    dimension = laspy.read(again).point_format.dimension_by_name("amplitude")
    assert (dimension.description, list(dimension.scales), list(dimension.offsets)) == (
        "dB",
        [0.01],
        [3.0],
    )


def test_moved_points_keep_a_tenth_of_a_millimetre(tmp_path):
    scan = read_scan(_las(tmp_path / "a.las", _geo_keys(k3072=2994, k3076=9002)))
    moved = scan.points + np.array([0.01234567, 1e4, -0.3])
    write_scan(tmp_path / "b.las", dataclasses.replace(scan, points=moved))
    after = read_scan(tmp_path / "b.las")
    assert 0.0 < np.abs(after.points - moved).max() <= 0.5e-4
    assert after.las.scales == pytest.approx([1e-4] * 3)
    # Stored as feet, and 32 bits do not hold them about the offset of the file.
    raw = laspy.read(tmp_path / "b.las")
    assert np.abs(np.asarray(raw.x) * 0.3048 - moved[:, 0]).max() < 1e-4
    assert raw.header.offsets[0] > 1e6


def test_a_scan_moved_into_the_frame_of_another_is_written_in_its_unit(tmp_path):
    feet = read_scan(_las(tmp_path / "a.las", _geo_keys(k3072=2994, k3076=9002)))
    utm = CoordinateSystem.from_wkt('PROJCS["UTM",UNIT["metre",1],AUTHORITY["EPSG","32633"]]')
    write_scan(tmp_path / "b.las", dataclasses.replace(feet, crs=utm))
    after = read_scan(tmp_path / "b.las")
    assert (after.crs.epsg, after.metres_per_unit) == (32633, (1, 1, 1))
    assert np.abs(after.points - feet.points).max() <= 0.5e-3 + 1e-9
    # Only LAS 1.4 has WKT instead of keys.
    assert (after.las.version, after.las.point_format) == ("1.4", 1)
    write_scan(tmp_path / "c.las", dataclasses.replace(feet, crs=None))
    bare = read_scan(tmp_path / "c.las")
    assert bare.crs is None
    assert np.abs(bare.points - feet.points).max() <= 0.5e-3 + 1e-9


def test_colours_change_the_point_format(tmp_path):
    scan = read_scan(_las(tmp_path / "a.las", version="1.1", point_format=1))
    colours = {name: np.arange(300, dtype=np.uint16) for name in ("red", "green", "blue")}
    write_scan(tmp_path / "b.las", dataclasses.replace(scan, fields={**scan.fields, **colours}))
    after = read_scan(tmp_path / "b.las")
    assert (after.las.version, after.las.point_format) == ("1.2", 3)
    assert np.array_equal(after.fields["blue"], colours["blue"])


def test_indices_of_points_are_dropped_with_a_note(tmp_path):
    index = laspy.VLR("copc", 10000, "COPC extents", bytes(32))
    scan = read_scan(_las(tmp_path / "a.las", index, laspy.VLR("me", 1, "", b"x")))
    assert "COPC index is not kept" in scan.notes[0]
    write_scan(tmp_path / "b.las", scan)
    assert [record[:2] for record in _header_facts(tmp_path / "b.las")["records"]] == [("me", 1)]


def test_a_given_unit_replaces_that_of_the_file(tmp_path):
    path = _las(tmp_path / "a.las", _geo_keys(k3072=2994, k3076=9001))
    scan = read_scan(path, scale=0.3048)
    assert np.abs(scan.points - 0.3048 * _RAW).max() < 1e-6
    assert "read in units of 0.3048 m, as asked" in scan.notes
    write_scan(tmp_path / "b.las", scan)
    assert np.array_equal(read_scan(tmp_path / "b.las", scale=0.3048).points, scan.points)
    assert _header_facts(tmp_path / "b.las") == _header_facts(path)


def test_millimetres_without_a_system_are_written_in_metres(tmp_path):
    path = _las(tmp_path / "a.las", points=1000 * (_RAW - _CORNER))
    scan = read_scan(path, scale=0.001)
    write_scan(tmp_path / "b.las", scan)
    after = read_scan(tmp_path / "b.las")
    assert np.abs(after.points - scan.points).max() <= 0.5e-5 + 1e-9
    assert np.abs(after.points - (_RAW - _CORNER)).max() < 1e-5


def test_a_damaged_record_or_scale_is_no_crash(tmp_path):
    data = bytearray(_las(tmp_path / "a.las", _geo_keys(k3072=2994)).read_bytes())
    data[131:139] = struct.pack("<d", 0.0)
    (tmp_path / "a.las").write_bytes(data)
    scan = read_scan(tmp_path / "a.las")
    write_scan(tmp_path / "b.las", scan)
    assert np.array_equal(read_scan(tmp_path / "b.las").points[:, 0], scan.points[:, 0])


def test_a_system_by_codes_is_written_as_keys(tmp_path):
    crs = CoordinateSystem(
        epsg=2992,
        vertical_epsg=8228,
        horizontal_unit="foot",
        vertical_unit="foot",
        metres_per_unit=(0.3048,) * 3,
    )
    points = _RAW - _CORNER
    write_scan(tmp_path / "a.las", ScanFile(points=points, fields={}, format="ply", crs=crs))
    after = read_scan(tmp_path / "a.las")
    assert dataclasses.replace(after.crs, records=()) == crs
    assert np.abs(np.asarray(laspy.read(tmp_path / "a.las").x) * 0.3048 - points[:, 0]).max() < 1e-4
    degrees = CoordinateSystem(epsg=4326, horizontal_unit="degree", is_geographic=True)
    write_scan(tmp_path / "b.las", ScanFile(points=points, fields={}, format="ply", crs=degrees))
    assert dataclasses.replace(read_scan(tmp_path / "b.las").crs, records=()) == degrees
    unnamed = CoordinateSystem()
    write_scan(tmp_path / "c.las", ScanFile(points=points, fields={}, format="ply", crs=unnamed))
    assert read_scan(tmp_path / "c.las").crs is None


def test_copc_is_not_written(tmp_path):
    with pytest.raises(InvalidInput, match=r"COPC cannot be written; write a\.laz"):
        write_scan(tmp_path / "a.copc.laz", _RAW)


def test_a_version_that_lacks_the_point_format_is_raised(tmp_path):
    scan = read_scan(_las(tmp_path / "a.las", version="1.2", point_format=1))
    old = dataclasses.replace(scan.las, version="1.0")
    write_scan(tmp_path / "b.las", dataclasses.replace(scan, las=old))
    assert read_scan(tmp_path / "b.las").las.version == "1.1"


def test_values_between_the_steps_of_a_scaled_dimension_are_rounded(tmp_path):
    path = _las(tmp_path / "a.las", extra=_EXTRA)
    scan = read_scan(path)
    fields = {**scan.fields, "amplitude": np.linspace(0.0, 10.0, 300)}
    write_scan(path, dataclasses.replace(scan, fields=fields))
    assert np.abs(read_scan(path).fields["amplitude"] - fields["amplitude"]).max() <= 0.0051
    fields["amplitude"] = np.full(300, 1e6)
    with pytest.raises(InvalidInput, match="amplitude cannot hold"):
        write_scan(path, dataclasses.replace(scan, fields=fields))
