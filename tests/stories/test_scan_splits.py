"""Halves of scans share no ring or block, and covariances hold between them."""

import importlib
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import chi2

from reference.samples import street

_ROOT = Path(__file__).resolve().parents[2]

pytestmark = pytest.mark.skipif(not (_ROOT / "benchmarks").is_dir(), reason="needs the benchmarks")


@pytest.fixture
def splits(monkeypatch):
    monkeypatch.syspath_prepend(_ROOT)
    return importlib.import_module("benchmarks._common.scan_splits")


def _elevations(points):
    return np.degrees(np.arctan2(points[:, 2], np.hypot(points[:, 0], points[:, 1])))


def test_halves_by_rings_share_no_band_of_elevation(splits):
    points, rng = street(1), np.random.default_rng(0)
    half = splits.by_rings(3.0)(points, rng)
    order = np.argsort(_elevations(points))
    changes = np.flatnonzero(np.diff(half[order].astype(int)))
    edges = _elevations(points[order])[changes]
    # Bands of 3 degrees; where the scan has no points, an edge is late.
    assert np.diff(edges).min() > 2.5
    assert 0.2 < half.mean() < 0.8


def test_halves_by_azimuth_are_blocks_of_one_to_two_widths(splits):
    azimuths = np.radians(np.linspace(-179.9, 179.9, 7200))
    points = np.column_stack([np.cos(azimuths), np.sin(azimuths), np.zeros(7200)])
    half = splits.by_azimuth(4.0)(points, np.random.default_rng(0))
    widths = np.diff(np.flatnonzero(np.diff(half.astype(int)))) / 20.0
    assert 3.9 < widths.min() < widths.max() < 8.1


def test_the_motion_between_halves_is_exact(splits):
    points, rng = street(1), np.random.default_rng(0)
    half = splits.by_points(points, rng)
    target, source, truth = splits.with_motion(points, half, rng)
    np.testing.assert_array_equal(target, points[half])
    np.testing.assert_allclose(truth.apply(source), points[~half], atol=1e-12)
    assert len(target) == len(source)


@pytest.mark.slow
@pytest.mark.data
def test_covariances_hold_for_real_scans_split_by_rings(splits, scan_data):
    module = importlib.import_module("benchmarks.uncertainty.real_splits")
    sensors = importlib.import_module("benchmarks._common.sensors")
    trials = module.Trials(("auto", "gicp"))
    for scan in list(sensors.real_scans_of_many_sensors(scan_data))[::8]:
        trials.run(scan, "rings")
    nees = np.array([one[4].nees for one in trials.found if one[4] is not None and one[4].is_ok])
    assert len(nees) > 24
    assert np.mean(nees < chi2.ppf(0.99, 6)) > 0.85
    assert 2.0 < np.mean(nees) < 12.0
