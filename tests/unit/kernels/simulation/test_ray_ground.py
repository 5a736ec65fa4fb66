import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from reference import ray_casting as reference
from scanlock.kernels.simulation.ray_ground import cast_at_ground
from scanlock.simulation.terrain.height_field import HeightField


def _field(seed, shape=(21, 34), relief=1.0):
    rng = np.random.default_rng(seed)
    return HeightField(relief * rng.normal(size=shape), np.array([-7.3, 2.1]), 0.7)


def _cast(field, origins, directions, max_distance=200.0):
    return cast_at_ground(
        origins, directions, np.full(len(origins), max_distance),
        field.heights, field.tops, field.corner, field.cell,
    )  # fmt: skip


def _rays(rng, field, count):
    size = field.cell * (np.array(field.heights.shape) - 1)
    origins = np.column_stack(
        [field.corner + rng.uniform(-0.4, 1.4, (count, 2)) * size, np.zeros(count)]
    )
    origins[:, 2] = rng.uniform(-4, 6, count)
    aims = np.column_stack([field.corner + rng.random((count, 2)) * size, rng.normal(size=count)])
    directions = aims - origins
    return origins, directions / np.linalg.norm(directions, axis=1, keepdims=True)


@pytest.mark.slow
@pytest.mark.parametrize("relief", [0.0, 0.1, 1.0])
def test_distances_match_the_definition(relief):
    field = _field(3, relief=relief)
    rng = np.random.default_rng(4)
    origins, directions = _rays(rng, field, 300)
    distances, _ = _cast(field, origins, directions)
    for origin, direction, distance in zip(origins, directions, distances, strict=True):
        expected = reference.ground_crossing(
            field.heights, field.corner, field.cell, origin, direction, 200.0
        )
        assert distance == pytest.approx(expected, abs=1e-6)
    assert 50 < np.isfinite(distances).sum() < 300


@given(
    x=st.floats(-7.3, 6.69), y=st.floats(2.1, 25.1), z=st.floats(4, 9), angle=st.floats(0, 6.3),
    fall=st.floats(0.05, 50),
)  # fmt: skip
def test_a_hit_is_on_the_ground_and_the_ray_before_it_above(x, y, z, angle, fall):
    field = _field(8, relief=0.4)
    direction = np.array([np.cos(angle), np.sin(angle), -fall])
    direction /= np.linalg.norm(direction)
    origin = np.array([x, y, z])
    [distance], _ = _cast(field, origin[None], direction[None])
    t = np.linspace(0, min(distance, 100.0), 200)[:-1]
    before = origin + t[:, None] * direction
    low, high = field.corner, field.corner + 0.7 * (np.array(field.heights.shape) - 1)
    before = before[((before[:, :2] >= low) & (before[:, :2] <= high)).all(axis=1)]
    assert (before[:, 2] > field.at(before)).all()
    if np.isfinite(distance):
        position = origin + distance * direction
        assert position[2] == pytest.approx(field.at(position[None])[0], abs=1e-9)


@pytest.mark.parametrize("node", [(0, 0), (8, 8), (16, 5), (20, 33), (3, 0)])
def test_a_vertical_ray_hits_the_height_of_a_node(node):
    field = _field(1)
    position = field.corner + field.cell * np.array(node)
    # Slightly inside, because rounding may move the outermost nodes off the grid.
    position = np.clip(
        position, field.corner, field.corner + 0.7 * np.array([19.999999, 32.999999])
    )
    [distance], _ = _cast(field, np.array([[*position, 50.0]]), np.array([[0.0, 0, -1]]))
    assert 50.0 - distance == pytest.approx(field.heights[node], abs=1e-4)


@pytest.mark.parametrize("direction", [(1, 0), (0, 1), (-1, 0), (0, -1), (1, 1), (1, -1)])
def test_rays_along_grid_lines_and_through_nodes_hit_the_ground(direction):
    field = HeightField(np.zeros((33, 33)), np.array([-16.0, -16.0]), 1.0)
    d = np.array([*direction, -0.2])
    d /= np.linalg.norm(d)
    origins = np.array([[x, y, 1.0] for x in range(-8, 9) for y in range(-8, 9)], float)
    distances, cosines = _cast(field, origins, np.tile(d, (len(origins), 1)))
    np.testing.assert_allclose(distances, -1.0 / d[2], rtol=1e-12)
    np.testing.assert_allclose(cosines, -d[2], rtol=1e-12)


def test_the_cosine_of_incidence_is_that_of_the_slope():
    field = HeightField.sampled(lambda xy: xy @ [0.3, -0.2], (-10, -10), (10, 10), 0.5)
    normal = np.array([-0.3, 0.2, 1.0]) / np.linalg.norm([-0.3, 0.2, 1.0])
    directions = np.array([[0.0, 0, -1], [0.6, 0, -0.8], [0, -0.6, -0.8]])
    _, cosines = _cast(field, np.tile([0.1, 0.2, 3.0], (3, 1)), directions)
    np.testing.assert_allclose(cosines, -directions @ normal, rtol=1e-9)


def test_there_is_no_hit_beyond_the_maximum_distance_or_the_edge():
    field = HeightField(np.zeros((9, 9)), np.zeros(2), 1.0)
    down = np.array([[0.0, 0, -1]])
    assert _cast(field, np.array([[4.0, 4, 3]]), down, max_distance=2.9)[0] == np.inf
    assert _cast(field, np.array([[4.0, 4, 3]]), down, max_distance=3.1)[0] == 3.0
    assert _cast(field, np.array([[8.5, 4, 3]]), down)[0] == np.inf
