import itertools
from dataclasses import replace

import numpy as np
import pytest

from scanlock.errors import InvalidInput
from scanlock.simulation import SimulatedSequence, forest_walk, hdl_32e, os1_64, scan_pair

pytestmark = pytest.mark.slow

_SEED = 3


@pytest.fixture(scope="module")
def sequence(forest_scene):
    drive = forest_walk(forest_scene, np.random.default_rng(8), count=12, spacing=2.0)
    return SimulatedSequence(world=forest_scene.world, sensor=hdl_32e(), drive=drive, seed=5)


def _bytes(scan):
    return b"".join(
        array.tobytes() for array in (scan.points, scan.labels, scan.objects, scan.times)
    )


def test_a_scan_does_not_depend_on_the_order_of_access(sequence):
    fifth = _bytes(sequence[5])
    some = list(sequence.scans(range(1, 12, 4)))
    assert _bytes(some[1]) == fifth
    assert _bytes(sequence[-7]) == fifth
    *_, last = itertools.islice(iter(sequence), 6)
    assert _bytes(last) == fifth


def test_scans_have_the_pose_and_twist_of_the_drive(sequence):
    scan = sequence[7]
    assert scan.pose == sequence.drive.poses[7]
    assert np.array_equal(scan.twist, sequence.drive.twists[7])
    assert scan.time == sequence.drive.times[7]
    assert len(sequence) == 12


def test_another_seed_gives_other_noise_on_the_same_objects(sequence):
    other = replace(sequence, seed=6)
    assert _bytes(other[0]) != _bytes(sequence[0])
    assert set(other[0].objects) & set(sequence[0].objects)


def test_scans_are_simulated_on_access(sequence):
    scans = sequence.scans(iter([3, 999]))
    assert len(next(scans)) > 0
    with pytest.raises(IndexError, match="scan 999 of a sequence of 12"):
        next(scans)


def test_a_pair_has_the_given_baseline_and_turn(forest_scene):
    for seed in range(6):
        pair = scan_pair(forest_scene, os1_64(), seed, baseline=(3.0, 5.0))
        metres, radians = pair.target.pose.distance(pair.source.pose)
        # The straight distance is shorter than the track, and both may be beside it.
        assert 2.0 < metres < 5.5
        assert radians < np.radians(15.0) + 0.25
        exact = pair.target.pose.inverse() @ pair.source.pose
        assert exact.is_close(pair.target_from_source, translation=1e-12, rotation=1e-12)


def test_the_exact_pose_aligns_a_pair_up_to_noise(forest_scene):
    pair = scan_pair(forest_scene, "os1_64", 1)
    shared = np.intersect1d(pair.target.objects, pair.source.objects)
    assert len(shared) > 50
    moved = pair.target_from_source.apply(pair.source.points)
    # Rays to the source points, cast again from the pose of the source in the target frame.
    origin = pair.target.pose.apply(pair.target_from_source.translation)
    rays = pair.target.pose.apply(moved) - origin
    ranges = np.linalg.norm(rays, axis=1)
    hits = forest_scene.world.cast(
        np.tile(origin, (len(rays), 1)), rays / ranges[:, None], 0.0, np.zeros(len(rays)), 130.0
    )
    residuals = ranges - hits.distances
    # The residuals are the range noise, 3 cm.
    assert abs(residuals.mean()) < 0.002
    assert residuals.std() == pytest.approx(0.03, rel=0.05)
    assert (hits.objects == pair.source.objects).mean() > 0.999


def test_a_named_scene_is_generated_from_the_seed(forest_scene):
    drawn = scan_pair("forest", "hdl_32e", _SEED)
    given = scan_pair(forest_scene, hdl_32e(), _SEED)
    assert _bytes(drawn.target) == _bytes(given.target)
    assert _bytes(drawn.source) == _bytes(given.source)


@pytest.mark.parametrize(
    ("arguments", "options", "message"),
    [
        (("moon", "hdl_64e", 1), {}, "scene must be one of street, forest, rugged, got 'moon'"),
        (("forest", "eye", 1), {}, "sensor must be one of hdl_64e, .*, livox_avia, got 'eye'"),
        (("forest", "hdl_64e", -1), {}, "seed must be a whole number of at least 0"),
        (("forest", "hdl_64e", 1), {"baseline": (5.0, 3.0)}, "0 <= minimum <= maximum"),
    ],
)
def test_unknown_names_and_invalid_baselines_are_refused(arguments, options, message):
    with pytest.raises(InvalidInput, match=message):
        scan_pair(*arguments, **options)
