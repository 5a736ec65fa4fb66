"""Unsuitable and unusual clouds: an error, a status other than ok, or the correct pose."""

import numpy as np
import pytest

from contracts.traits import max_point_distance, result, source, target
from reference.pairs import register_pair
from scanlock.errors import InvalidInput
from scanlock.registration.register import register
from scanlock.registration.registry import METHODS

pytestmark = [pytest.mark.slow, pytest.mark.parametrize("method", METHODS)]

_LINE = np.outer(np.linspace(-20.0, 20.0, 5000), [1.0, 0.0, 0.0])
_POINT = np.tile([[3.0, 1.0, 0.0]], (5000, 1))


def _plane():
    rng = np.random.default_rng(0)
    return np.column_stack([rng.uniform(-20.0, 20.0, (6000, 2)), np.zeros(6000)])


def _ball(scan):
    """Another sample of the same sphere for each scan, invariant to all rotations."""
    seed = int(1e6 * abs(float(scan[0, 0])))
    ball = np.random.default_rng(seed).normal(size=(6000, 3))
    return 10.0 * ball / np.linalg.norm(ball, axis=1)[:, None]


_DEGENERATE = {
    "one point": lambda scan: scan[:1],
    "two points": lambda scan: scan[:2],
    "equal points": lambda scan: _POINT,
    "a line": lambda scan: _LINE,
    "a plane": lambda scan: _plane(),
    "a ball": _ball,
    "nothing returned": lambda scan: np.zeros((500, 3)),
    "micrometres across": lambda scan: 1e-6 * scan,
    "millimetres": lambda scan: 1e3 * scan,
    "thousands of kilometres": lambda scan: 1e6 * scan,
    "a billion times as large": lambda scan: 1e9 * scan,
}


@pytest.mark.parametrize("name", _DEGENERATE)
def test_degenerate_and_misscaled_clouds_are_never_ok(method, name):
    make = _DEGENERATE[name]
    for scans in ((make(source(method)), make(target())), (make(source(method)), target())):
        found = register_pair(scans, method=method)
        assert not found.ok
        assert found.reason
        assert np.isfinite(found.target_from_source.matrix).all()


def test_units_other_than_metres_are_noted(method):
    found = register(source=1e3 * source(method), target=target(), method=method)
    assert any("source" in note and "multiply by 0.001" in note for note in found.notes)
    found = register(source=source(method), target=1e-3 * target(), method=method)
    assert any("target" in note and "must be metres" in note for note in found.notes)
    assert not any("metres" in note for note in result(method).notes)


def test_a_mirrored_scan_is_never_ok(method):
    mirror = np.array([1.0, -1.0, 1.0])
    assert not register(source=source(method) * mirror, target=target(), method=method).ok
    # Two mirrored scans are in left-handed frames, with a rigid motion between them.
    both = register(source=source(method) * mirror, target=target() * mirror, method=method)
    assert both.ok
    rotation = both.target_from_source.rotation
    expected = result(method).target_from_source.rotation
    mirrored = expected * np.outer(mirror, mirror)
    assert np.abs(rotation - mirrored).max() < 0.01


@pytest.mark.parametrize("far", [1e6, 1e11])
def test_an_extreme_outlier_does_not_change_the_pose(method, far):
    points = np.vstack([source(method), [[far, -far, far]]])
    found = register(source=points, target=target(), method=method)
    assert found.ok
    assert (
        max_point_distance(
            found.target_from_source, result(method).target_from_source, source(method)
        )
        < 0.02
    )


def test_repeated_points_do_not_bias_the_pose(method):
    found = register(source=np.repeat(source(method), 3, axis=0), target=target(), method=method)
    assert found.ok
    assert (
        max_point_distance(
            found.target_from_source, result(method).target_from_source, source(method)
        )
        < 0.1
    )


_LAYOUTS = {
    "Fortran": np.asfortranarray,
    "big-endian": lambda scan: scan.astype(">f8"),
    "strided": lambda scan: np.repeat(scan, 2, axis=0)[::2],
    "backwards in memory": lambda scan: scan[::-1].copy()[::-1],
    "columns of a wider array": lambda scan: np.column_stack([scan, scan, scan])[:, :3],
    "wide": lambda scan: np.column_stack([scan, np.full((len(scan), 2), np.nan)]),
    "extended": lambda scan: scan.astype(np.longdouble),
    "a list": lambda scan: scan.tolist(),
    "masked nowhere": lambda scan: np.ma.array(scan, mask=False),
}


@pytest.mark.parametrize("name", _LAYOUTS)
def test_memory_layouts_give_identical_results(method, name):
    convert = _LAYOUTS[name]
    found = register(source=convert(source(method)), target=convert(target()), method=method)
    assert found.target_from_source == result(method).target_from_source
    assert found.probability == result(method).probability


def test_integers_are_converted_without_scaling(method):
    whole = [np.round(scan).astype(np.int16) for scan in (source(method), target())]
    as_floats = [scan.astype(np.float64) for scan in whole]
    found, expected = register_pair(whole, method=method), register_pair(as_floats, method=method)
    assert found.target_from_source == expected.target_from_source


@pytest.mark.parametrize(
    ("scan", "message"),
    [
        (None, "got None"),
        ("scan.ply", "read_scan reads files"),
        (np.zeros((3, 500)), "transpose it: source.T"),
        (np.zeros((9, 3), complex), "dtype complex128"),
        (np.zeros((9, 3), object), "convert it"),
        (np.zeros((1, 9, 3)), r"shape \(n, 3\)"),
        (np.zeros(9, [("a", float), ("b", float), ("c", float)]), "np.column_stack"),
    ],
)
def test_invalid_clouds_are_refused_with_a_remedy(method, scan, message):
    with pytest.raises(InvalidInput, match=f"source.*{message}"):
        register(source=scan, target=target(), method=method)
