import numpy as np
import pytest

from reference import compatibility as reference
from reference.samples import rotated_covariances
from scanlock.arrays import read_only
from scanlock.kernels.search.compatibility import (
    free_compatibility,
    level_compatibility,
    soft_overlap,
)

_TOLERANCES = np.array([0.5, 0.1, 0.2, 2.0])


_THRESHOLDS = np.array([1.0, 4.0, 12.0])


_ROWS, _COLUMNS = np.triu_indices(3)


def _matches(count=70):
    """Matches of which many are compatible: the positions on both sides differ by little."""
    rng = np.random.default_rng(5)
    target = rng.uniform(-8.0, 8.0, (count, 3)) * [1.0, 1.0, 0.2]
    source = target + rng.normal(0.0, 1.0, (count, 3))
    covariances = [
        rotated_covariances(rng, rng.uniform(0.01, 0.1, (count, 3)))[:, _ROWS, _COLUMNS]
        for _ in range(2)
    ]
    return rng, [read_only(array) for array in (target, source, *covariances)]


def _bits(graph):
    """Adjacency of a graph of packed bits."""
    count = graph.shape[-2]
    octets = np.ascontiguousarray(graph).astype("<u8").view(np.uint8)
    return np.unpackbits(octets, axis=-1, bitorder="little")[..., :count].astype(bool)


def _assert_graph(graph, expected):
    np.testing.assert_array_equal(_bits(graph), expected)
    ratios = expected.mean(axis=(1, 2))
    assert (np.diff(ratios) > 0.02).all()
    assert ratios[0] > 0.02
    assert ratios[-1] < 0.98


def test_level_compatibility_matches_the_definition():
    rng, matches = _matches()
    angles = rng.normal(0.0, 0.3, 70)
    headings = np.stack([np.cos(2 * angles), np.sin(2 * angles)], axis=1)
    headings[::3] = 0.0
    arguments = *matches, read_only(headings), read_only(_TOLERANCES)
    expected = reference.agreements(
        lambda a, b: reference.level_misfit(*arguments, a, b), 70, _THRESHOLDS
    )
    _assert_graph(level_compatibility(*arguments, read_only(_THRESHOLDS)), expected)


def test_free_compatibility_matches_the_definition():
    rng, matches = _matches()
    axes = rng.normal(size=(70, 3))
    axes /= np.linalg.norm(axes, axis=1)[:, None]
    other = axes + rng.normal(0.0, 0.2, (70, 3))
    other /= -np.linalg.norm(other, axis=1)[:, None]
    axes[::3] = other[::3] = 0.0
    arguments = *matches, read_only(axes), read_only(other), read_only(_TOLERANCES)
    expected = reference.agreements(
        lambda a, b: reference.free_misfit(*arguments, a, b), 70, _THRESHOLDS
    )
    _assert_graph(free_compatibility(*arguments, read_only(_THRESHOLDS)), expected)


def test_matches_of_one_cluster_are_incompatible():
    _, (target, source, target_covariances, source_covariances) = _matches(6)
    same = read_only(np.broadcast_to(target[0], (6, 3)))
    covariances = read_only(1e6 * target_covariances), read_only(1e6 * source_covariances)
    rest = read_only(_TOLERANCES), read_only(_THRESHOLDS)
    headings, axes = read_only(np.zeros((6, 2))), read_only(np.zeros((6, 3)))
    assert not level_compatibility(same, source, *covariances, headings, *rest).any()
    assert not free_compatibility(target, same, *covariances, axes, axes, *rest).any()


def test_soft_overlap_matches_the_definition():
    rng = np.random.default_rng(8)
    target, source = rng.uniform(-3.0, 3.0, (40, 3)), rng.uniform(-3.0, 3.0, (50, 3))
    affinities = rng.random((50, 40))
    arguments = read_only(target), read_only(source), read_only(affinities), 0.8
    assert soft_overlap(*arguments) == pytest.approx(reference.soft_overlap(*arguments))
    # A cluster counts once, with any number of overlaps.
    once = read_only(np.zeros((1, 3))), read_only(np.zeros((9, 3))), read_only(np.ones((9, 1)))
    assert soft_overlap(*once, 1.0) == 1.0
