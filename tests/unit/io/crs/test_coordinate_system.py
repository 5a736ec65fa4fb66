import contextlib
import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scanlock.errors import InvalidInput
from scanlock.io import CoordinateSystem
from scanlock.io.crs.units import (
    FOOT,
    METRE,
    US_SURVEY_FOOT,
    unit_of_projected_system,
    unit_of_vertical_system,
)
from scanlock.io.crs.wkt import parse_wkt

_US_FOOT = 1200 / 3937

_UTM_1 = """PROJCS["WGS 84 / UTM zone 33N",GEOGCS["WGS 84",DATUM["WGS_1984",SPHEROID["WGS 84",
6378137,298.257223563]],PRIMEM["Greenwich",0],UNIT["degree",0.0174532925199433],
AUTHORITY["EPSG","4326"]],PROJECTION["Transverse_Mercator"],UNIT["metre",1,
AUTHORITY["EPSG","9001"]],AUTHORITY["EPSG","32633"]]"""
_UTM_2 = """PROJCRS["WGS 84 / UTM zone 33N",BASEGEOGCRS["WGS 84",DATUM["World Geodetic System 1984",
ELLIPSOID["WGS 84",6378137,298.257223563,LENGTHUNIT["metre",1]]]],CONVERSION["UTM zone 33N",
METHOD["Transverse Mercator"],PARAMETER["False easting",500000,LENGTHUNIT["metre",1]]],
CS[Cartesian,2],AXIS["easting (E)",east,ORDER[1],LENGTHUNIT["metre",1]],
AXIS["northing (N)",north,ORDER[2],LENGTHUNIT["metre",1]],ID["EPSG",32633]]"""
_COMPOUND = """COMPOUNDCRS["Oregon (ft) + NAVD88 height (ftUS)",PROJCRS["Oregon (ft)",
BASEGEOGCRS["NAD83",DATUM["x",ELLIPSOID["GRS 1980",6378137,298.257,LENGTHUNIT["metre",1]]]],
CS[Cartesian,2],AXIS["x",east],AXIS["y",north],LENGTHUNIT["foot",0.3048],ID["EPSG",2994]],
VERTCRS["NAVD88 height (ftUS)",VDATUM["NAVD88"],CS[vertical,1],AXIS["H",up,
LENGTHUNIT["US survey foot",0.304800609601219]],ID["EPSG",6360]]]"""
_DEGREES_3D = """GEOGCRS["WGS 84",DATUM["x",ELLIPSOID["WGS 84",6378137,298.257]],CS[ellipsoidal,3],
AXIS["latitude",north,ANGLEUNIT["degree",0.0174532925199433]],
AXIS["longitude",east,ANGLEUNIT["degree",0.0174532925199433]],
AXIS["height",up,LENGTHUNIT["metre",1]],ID["EPSG",4979]]"""
_ESRI = """PROJCS["NAD_1983_StatePlane_Oregon_North_FIPS_3601_Feet",GEOGCS["GCS",
UNIT["Degree",0.0174532925199433]],UNIT["Foot_US",0.3048006096012192]],VERTCS["NAVD_1988",
VDATUM["x"],PARAMETER["Vertical_Shift",0.0],UNIT["Meter",1.0]]"""


@pytest.mark.parametrize(
    ("text", "codes", "units", "metres"),
    [
        (_UTM_1, (32633, None), ("metre", "metre"), (1, 1, 1)),
        (_UTM_2, (32633, None), ("metre", "metre"), (1, 1, 1)),
        (_COMPOUND, (2994, 6360), ("foot", "US survey foot"), (0.3048, 0.3048, _US_FOOT)),
        (_ESRI, (None, None), ("US survey foot", "metre"), (_US_FOOT, _US_FOOT, 1)),
        ('LOCAL_CS["site"]', (None, None), ("unknown", "unknown"), (1, 1, 1)),
        ('LOCAL_CS["site",UNIT["rod",5.0292]]', (None, None), ("rod", "rod"), (5.0292,) * 3),
        ('GEODCRS["x",CS[Cartesian,3],LENGTHUNIT["metre",1],ID["EPSG",4978]]', (4978, None),
         ("metre", "metre"), (1, 1, 1)),
    ],
)  # fmt: skip
def test_codes_and_units_are_read_from_wkt(text, codes, units, metres):
    crs = CoordinateSystem.from_wkt(text + "\0")
    assert (crs.epsg, crs.vertical_epsg) == codes
    assert (crs.horizontal_unit, crs.vertical_unit) == units
    assert crs.metres_per_unit == metres
    assert not crs.is_geographic
    assert crs.wkt == text
    crs.require_lengths("a.las")
    assert pickle.loads(pickle.dumps(crs)) == crs
    assert hash(crs) == hash(CoordinateSystem.from_wkt(text))


@pytest.mark.parametrize(
    ("text", "code", "height"),
    [
        (_DEGREES_3D, 4979, "metre"),
        ('GEOGCS["WGS 84",UNIT["degree",0.01745],AUTHORITY["EPSG","4326"]]', 4326, "unknown"),
        ('GEODCRS["WGS 84",CS[ellipsoidal,2],ID["EPSG",4326]]', 4326, "unknown"),
    ],
)
def test_degrees_are_recognised_and_refused_by_name(text, code, height):
    crs = CoordinateSystem.from_wkt(text)
    assert (crs.epsg, crs.is_geographic) == (code, True)
    assert (crs.horizontal_unit, crs.vertical_unit) == ("degree", height)
    assert crs.metres_per_unit == (1, 1, 1)
    with pytest.raises(InvalidInput, match=rf"^a\.las: .*degrees \(WGS 84 \(EPSG:{code}\)\)"):
        crs.require_lengths("a.las")
    with pytest.raises(InvalidInput, match="scale must not be given for degrees"):
        crs.with_unit(0.3048)


def test_missing_units_are_noted():
    assert CoordinateSystem.from_wkt(_UTM_1).notes == ()
    [unknown] = CoordinateSystem.from_wkt('PROJCS["x"]').notes
    assert "does not state the unit: taken as metres" in unknown
    [height] = CoordinateSystem.from_wkt('PROJCS["x",UNIT["foot",0.3048]]').notes
    assert "unit of heights: taken as foot" in height


def test_the_unit_of_an_epsg_code_is_used_and_compared():
    by_code = CoordinateSystem.from_wkt('PROJCS["x",AUTHORITY["EPSG","2994"]]')
    assert by_code.horizontal_unit == "foot"
    assert by_code.notes[0] == (
        "the file does not state the unit of x and y: that of EPSG:2994 is used"
    )
    text = 'PROJCS["x",UNIT["metre",1],AUTHORITY["EPSG","2994"]]'
    contradiction = CoordinateSystem.from_wkt(text)
    assert contradiction.horizontal_unit == "metre"
    assert contradiction.notes[0] == (
        "the file states metre for x and y (used), but EPSG:2994 is in foot"
    )


@pytest.mark.parametrize(
    ("code", "unit"),
    [
        (32633, METRE),
        (2949, METRE),
        (28992, METRE),
        (2225, US_SURVEY_FOOT),
        (2250, US_SURVEY_FOOT),
        (6411, US_SURVEY_FOOT),
        (2251, FOOT),
        (2992, FOOT),
        (24371, None),
        (32767, None),
        (None, None),
    ],
)
def test_units_of_projected_systems(code, unit):
    assert unit_of_projected_system(code) == unit


@pytest.mark.parametrize(
    ("code", "unit"),
    [(5703, METRE), (5773, METRE), (6360, US_SURVEY_FOOT), (8228, FOOT), (5103, None)],
)
def test_units_of_vertical_systems(code, unit):
    assert unit_of_vertical_system(code) == unit


def test_another_unit_replaces_the_stated_one():
    crs = CoordinateSystem.from_wkt(_COMPOUND).with_unit(0.001)
    assert crs.metres_per_unit == (0.001, 0.001, 0.001)
    assert crs.unit_text == "unit of 0.001 m"
    assert crs.epsg == 2994
    with pytest.raises(InvalidInput, match="scale must be positive"):
        crs.with_unit(-1.0)


def test_label_and_units_for_people():
    crs = CoordinateSystem.from_wkt(_COMPOUND)
    assert crs.label == "Oregon (ft) + NAVD88 height (ftUS) (EPSG:2994 + EPSG:6360)"
    assert crs.unit_text == "foot (0.3048 m), heights in US survey foot (0.3048006 m)"
    assert CoordinateSystem(epsg=7415).label == "EPSG:7415"
    assert CoordinateSystem(name="site").label == "site"
    assert CoordinateSystem().unit_text == "unknown unit, read as metres"


@pytest.mark.parametrize(
    "text",
    ["", "EPSG:4326", "PROJCS[", 'PROJCS["x"]]', "[1]", 'PROJCS["x', 'DATUM["x"]', "UNIT"],
)
def test_text_that_is_no_system_is_refused(text):
    with pytest.raises(InvalidInput, match="expected the well-known text"):
        CoordinateSystem.from_wkt(text)


@given(st.text('PROJCS[](),"1 e-', max_size=60))
def test_any_text_is_parsed_or_refused(text):
    with contextlib.suppress(InvalidInput):
        assert CoordinateSystem.from_wkt(text).metres_per_unit[0] > 0.0


def test_quotes_brackets_and_deep_nesting_are_parsed():
    [node] = parse_wkt('A("say ""x"" [1]", 2, b["c"]) ')
    assert (node.keyword, node.name, node.values[1]) == ("A", 'say "x" [1]', "2")
    assert node.child("B").values == ("c",)
    deep = "A[" * 5000 + '"x"' + "]" * 5000
    with pytest.raises(InvalidInput, match="no coordinate reference system"):
        CoordinateSystem.from_wkt(deep)


def test_feet_of_both_kinds_are_distinguished():
    for text, metres in (("0.3048", 0.3048), ("0.3048006", _US_FOOT), ("0.30480061", _US_FOOT)):
        crs = CoordinateSystem.from_wkt(f'PROJCS["x",UNIT["ft",{text}]]')
        assert np.all(np.array(crs.metres_per_unit) == metres)
