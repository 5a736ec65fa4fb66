import functools
import inspect

import numpy as np
import pytest

from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.simulation.scenes.repeating import REPEATING, Visit

_SIZES = {
    "car_park": {"bays": 15, "aisles": 1},
    "warehouse": {"racks": 2, "bays": 9},
    "orchard": {"rows": 2, "length": 60.0, "variety": 0.0},
    "vineyard": {"rows": 4, "variety": 0.0},
    "avenue": {"length": 80.0, "variety": 0.0},
    "ringed_tunnel": {"length": 90.0},
    "terraced_street": {"houses": 15},
    "crossroads": {"houses": 3},
    "office_floor": {"rooms": 6},
    "container_yard": {"rows": 2},
}


@functools.cache
def _make(name, things=1.0, seed=5, **visit):
    return REPEATING[name](Visit(seed=seed, **visit), things=things, **_SIZES.get(name, {}))


def _rows(made):
    """Surfaces of a world, as a set of bytes."""
    return {row.tobytes() for row in made.world.surfaces.rows}


@pytest.mark.parametrize("name", REPEATING)
def test_the_same_visit_gives_the_same_bytes(name):
    one, again, other = _make(name), _make.__wrapped__(name), _make(name, seed=6)
    assert one.kind == name
    assert one.world.surfaces.rows.tobytes() == again.world.surfaces.rows.tobytes()
    assert one.places.tobytes() == again.places.tobytes()
    assert one.world.surfaces.rows.tobytes() != other.world.surfaces.rows.tobytes()


@pytest.mark.parametrize("name", REPEATING)
def test_another_visit_or_part_has_the_same_structure_and_other_things(name):
    structure = _rows(_make(name, things=0.0))
    first = _rows(_make(name, things=2.0))
    assert structure < first
    assert _rows(_make(name, things=2.0, number=1)) == first
    kept = []
    for changed in (0.3, 1.0):
        visit = _rows(_make(name, things=2.0, number=1, changed=changed))
        assert structure < visit
        assert visit != first
        kept.append(len(visit & first - structure) / len(first - structure))
    assert 0.3 < kept[0] < 0.95
    assert kept[1] < 0.1
    elsewhere = _rows(_make(name, things=2.0, part=1))
    assert structure < elsewhere
    assert len(elsewhere & first - structure) < 0.1 * len(first - structure)


def _free_distance(made, clear):
    """Smallest distance of a surface from the places, at 0.4 m and at the height of the sensor."""
    angles = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
    ring = np.column_stack([np.cos(angles), np.sin(angles), 0.0 * angles])
    least = np.inf
    for height in (0.4, 0.8, made.sensor_height):
        origins = np.repeat(made.places + np.array([0.0, 0.0, height]), 24, axis=0)
        rays = np.tile(ring, (len(made.places), 1))
        hits = made.world.cast(origins, rays, 0.0, np.zeros(len(rays)), clear)
        least = min(least, hits.distances.min())
    return least


@pytest.mark.parametrize("name", REPEATING)
def test_places_are_on_the_floor_and_free_of_things(name):
    for seed in (5, 6):
        made = _make(name, seed=seed)
        assert len(made.places) >= 3
        assert _free_distance(made, 5.0) > 0.3
    down = np.tile([0.0, 0.0, -1.0], (len(made.places), 1))
    origins = made.places + np.array([0.0, 0.0, 0.2])
    hits = made.world.cast(origins, down, 0.0, np.zeros(len(down)), 5.0)
    np.testing.assert_allclose(hits.distances, 0.2, atol=1e-6)


_SYMMETRIC = sorted(set(REPEATING) - {"furnished_room"})


@pytest.mark.parametrize("name", _SYMMETRIC)
def test_the_symmetry_maps_the_structure_to_itself(name):
    made = _make(name, things=0.0)
    rng = np.random.default_rng(0)
    middle = made.places[len(made.places) // 2 - 1]
    rays = rng.normal(size=(1000, 3))
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    origins = np.tile(middle + np.array([0.0, 0.0, made.sensor_height]), (1000, 1))

    def distances(pose):
        hits = made.world.cast(
            pose.apply(origins), rays @ pose.rotation.T, 0.0, np.zeros(1000), 12.0
        )
        return np.minimum(hits.distances, 99.0)

    def share_equal(pose):
        return np.isclose(distances(pose), here, atol=1e-6).mean()

    here = distances(Pose.identity())
    assert (here < 99.0).mean() > 0.3
    # Frames of a hall and masts of a platform have another period.
    assert share_equal(made.symmetry) > 0.9
    if not np.allclose(made.symmetry.translation, 0.0):
        half = Pose(made.symmetry.rotation, 0.5 * made.symmetry.translation)
        assert share_equal(half) < share_equal(made.symmetry) - 0.002


def test_a_room_has_no_symmetry():
    assert _make("furnished_room").symmetry is None


@pytest.mark.parametrize("name", REPEATING)
def test_sizes_that_are_not_positive_are_refused(name):
    parameters = inspect.signature(REPEATING[name]).parameters
    sizes = set(parameters) - {"visit", "occupancy", "variety"}
    assert len(sizes) >= 3
    for size in sizes:
        with pytest.raises(InvalidInput, match=size):
            REPEATING[name](Visit(seed=1), **{size: -1})


def test_a_visit_out_of_range_is_refused():
    for name, value in (("seed", -1), ("part", -1), ("number", -1), ("changed", 1.5)):
        with pytest.raises(InvalidInput, match=name):
            Visit(**({"seed": 1} | {name: value}))
