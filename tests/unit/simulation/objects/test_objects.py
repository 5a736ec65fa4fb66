import numpy as np
import pytest

from scanlock.simulation import SurfaceClass
from scanlock.simulation.objects import buildings, furniture, movables, plants, traffic

_OBJECTS = {
    "tree": (lambda r: plants.tree(r, height=9.0, crown_radius=2.5, trunk_radius=0.2),
             {SurfaceClass.TRUNK, SurfaceClass.FOLIAGE}, 12.0),
    "conifer": (lambda r: plants.conifer(r, height=9.0, radius=2.0),
                {SurfaceClass.TRUNK, SurfaceClass.FOLIAGE}, 11.0),
    "shrub": (lambda r: plants.shrub(r, radius=0.8, height=1.2), {SurfaceClass.SHRUB}, 2.5),
    "hedge": (lambda r: plants.hedge(r, length=6.0, width=0.7, height=1.2),
              {SurfaceClass.SHRUB}, 1.6),
    "grass": (lambda r: plants.grass(r, np.zeros((9, 3)), 0.2), {SurfaceClass.GRASS}, 0.4),
    "log": (lambda r: plants.log(r, length=4.0, radius=0.2), {SurfaceClass.TRUNK}, 0.7),
    "street lamp": (furniture.street_lamp, {SurfaceClass.POLE}, 10.0),
    "traffic sign": (furniture.traffic_sign, {SurfaceClass.POLE}, 3.1),
    "traffic light": (furniture.traffic_light, {SurfaceClass.POLE}, 3.7),
    "wooden pole": (furniture.wooden_pole, {SurfaceClass.POLE}, 10.1),
    "bollards": (lambda r: furniture.bollards(r, 4), {SurfaceClass.POLE}, 1.1),
    "fence": (lambda r: furniture.fence(r, length=7.0), {SurfaceClass.FENCE}, 1.6),
    "garden wall": (lambda r: furniture.garden_wall(r, length=7.0), {SurfaceClass.FENCE}, 1.8),
    "bins": (lambda r: furniture.bins(r, 3), {SurfaceClass.FURNITURE}, 1.3),
    "boulder": (furniture.boulder, {SurfaceClass.ROCK}, 1.2),
    "gazebo": (furniture.gazebo, {SurfaceClass.GAZEBO}, 5.3),
    "car": (traffic.car, {SurfaceClass.CAR}, 2.4),
    "person": (traffic.person, {SurfaceClass.PERSON}, 2.1),
    "house": (lambda r: buildings.house(r, width=14.0, depth=9.0, storeys=3, forecourt=2.0),
              {SurfaceClass.BUILDING}, 19.0),
    "crate": (movables.crate, {SurfaceClass.FURNITURE}, 1.8),
    "pallet": (movables.pallet, {SurfaceClass.FURNITURE}, 1.8),
    "rack load": (movables.rack_load, {SurfaceClass.FURNITURE}, 1.3),
    "trolley": (movables.trolley, {SurfaceClass.FURNITURE}, 1.1),
    "forklift": (movables.forklift, {SurfaceClass.CAR}, 2.7),
    "traffic cone": (movables.traffic_cone, {SurfaceClass.FURNITURE}, 1.0),
    "chair": (movables.chair, {SurfaceClass.FURNITURE}, 1.1),
    "table": (movables.table, {SurfaceClass.FURNITURE}, 1.3),
    "shelf": (movables.shelf, {SurfaceClass.FURNITURE}, 2.3),
    "sofa": (movables.sofa, {SurfaceClass.FURNITURE}, 1.0),
    "bench": (movables.bench, {SurfaceClass.FURNITURE}, 1.0),
    "planter": (movables.planter, {SurfaceClass.FURNITURE, SurfaceClass.SHRUB}, 1.7),
    "bicycle": (movables.bicycle, {SurfaceClass.FURNITURE}, 1.1),
    "container": (movables.container, {SurfaceClass.BUILDING}, 7.8),
    "rubbish bins": (movables.rubbish_bins, {SurfaceClass.FURNITURE}, 1.3),
    "shed": (lambda r: buildings.shed(r, width=4.0, depth=5.0), {SurfaceClass.BUILDING}, 8.0),
}  # fmt: skip


@pytest.mark.parametrize("name", _OBJECTS)
def test_an_object_is_on_the_ground_with_its_classes_and_height(name):
    make, classes, tallest = _OBJECTS[name]
    for seed in range(8):
        surfaces = make(np.random.default_rng(seed))
        bounds = surfaces.bounds()
        assert set(surfaces.labels) == classes
        assert bounds[:, 2].min() < 1e-3
        assert 0.1 < bounds[:, 5].max() < tallest


@pytest.mark.parametrize("name", _OBJECTS)
def test_objects_differ_by_seed_and_are_reproducible(name):
    make, _, _ = _OBJECTS[name]
    first, again, other = (make(np.random.default_rng(seed)) for seed in (0, 0, 1))
    assert first.rows.tobytes() == again.rows.tobytes()
    assert first.rows.tobytes() != other.rows.tobytes()


@pytest.mark.parametrize("forecourt", [0.3, 0.9, 2.5])
def test_a_house_is_within_its_plot_and_forecourt(forecourt):
    for seed in range(20):
        house = buildings.house(
            np.random.default_rng(seed), width=12.0, depth=9.0, storeys=2, forecourt=forecourt
        )
        bounds = house.bounds()
        walls = bounds[bounds[:, 2] < 2.0]
        assert walls[:, 1].min() > -max(forecourt, 0.2) - 1e-3
        assert walls[:, 4].max() < 9.0 + 1e-3
        assert np.abs(walls[:, [0, 3]]).max() < 6.0 + 0.7


def test_fewer_leaves_are_larger_with_the_same_total_area():
    areas = []
    for leaves in (1.0, 0.25):
        tree = plants.tree(
            np.random.default_rng(5), height=9.0, crown_radius=2.5, trunk_radius=0.2, leaves=leaves
        )
        discs = tree.rows[tree.labels == SurfaceClass.FOLIAGE]
        areas.append((len(discs), np.pi * (discs[:, 12] * discs[:, 13]).sum()))
    (many, area), (few, same) = areas
    assert few == pytest.approx(0.25 * many, rel=0.02)
    assert same == pytest.approx(area, rel=0.1)
