import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from reference import ray_casting as reference
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import exp_rotation
from scanlock.kernels.simulation.ray_casting import NOTHING, cast_at_movers, cast_rays
from scanlock.simulation.objects.shapes import boxes, cones, discs, ellipsoids, triangles
from scanlock.simulation.objects.surface_class import SurfaceClass
from scanlock.simulation.objects.surfaces import Surfaces
from scanlock.simulation.world import World

_KINDS = ["box", "cone", "ellipsoid", "disc", "triangle"]
_numbers = st.floats(-5, 5)
_vectors = arrays(np.float64, 3, elements=_numbers)
_sizes = st.floats(0.05, 4)


@st.composite
def _surface(draw, kind):
    label = SurfaceClass.POLE
    centre, rotation_vector = draw(_vectors), draw(_vectors)
    a, b, c = draw(_sizes), draw(_sizes), draw(_sizes)
    rotation = exp_rotation(rotation_vector)
    if kind == "box":
        return boxes(centre, [a, b, c], label, rotations=rotation)
    if kind == "ellipsoid":
        return ellipsoids(centre, [a, b, c], label, rotations=rotation)
    if kind == "cone":
        # The top may be a point.
        top = draw(st.sampled_from([b, 0.0, a]))
        return cones(centre - c * rotation[:, 2], centre + c * rotation[:, 2], a, top, label)
    if kind == "disc":
        return discs(centre, rotation[:, 2], [[a, b]], label)
    corners = np.array([[0, 0, 0], [a, 0, 0], [draw(_numbers), c, 0]]) @ rotation.T + centre
    return triangles(corners, label)


@st.composite
def _ray(draw, target, spread):
    origin = draw(_vectors) * 2
    # Most rays aim near the surface; random ones would miss.
    direction = target + draw(_vectors) * spread - origin
    length = np.linalg.norm(direction)
    assume(length > 1e-3)
    return origin, direction / length


def _centre_of(surface):
    bounds = surface.bounds()[0]
    return (bounds[:3] + bounds[3:]) / 2


def _cast_one(surfaces, origin, direction, max_distance=900.0):
    world = World.of(surfaces)
    hits = world.cast(origin[None], direction[None], 0.0, np.zeros(1), max_distance)
    return hits.distances[0], hits.cosines[0]


@pytest.mark.slow
@pytest.mark.parametrize("kind", _KINDS)
@given(data=st.data())
def test_the_distance_to_a_surface_matches_the_definition(kind, data):
    surface = data.draw(_surface(kind))
    origin, direction = data.draw(_ray(_centre_of(surface), 0.3))
    row = surface.rows[0]
    if kind not in ("disc", "triangle"):
        assume(abs(reference.gauge(kind, row[12:], reference.to_local(row, origin))) > 1e-6)
    assume(reference.clearance(kind, row, origin, direction) > 1e-6)
    expected = reference.crossing(kind, row, origin, direction)
    distance, cosine = _cast_one(surface, origin, direction)
    if np.isinf(expected):
        assert np.isinf(distance)
        assert cosine == 0.0
    else:
        assert distance == pytest.approx(expected, abs=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("kind", _KINDS)
@given(data=st.data())
def test_the_cosine_of_incidence_matches_the_gradient_of_the_definition(kind, data):
    surface = data.draw(_surface(kind))
    row = surface.rows[0]
    origin, direction = data.draw(_ray(_centre_of(surface), 0.05))
    distance, cosine = _cast_one(surface, origin, direction)
    assume(np.isfinite(distance))
    position = origin + distance * direction
    # At an edge or a corner, no normal is correct.
    nudges = np.vstack([np.zeros((1, 3)), np.eye(3), -np.eye(3)]) * 1e-5
    around = [reference.incidence_cosine(kind, row, position + n, direction) for n in nudges]
    assume(np.ptp(around) < 1e-2)
    assert cosine == pytest.approx(around[0], abs=1e-3)


def _many(rng, count):
    def position():
        return rng.uniform(-8, 8, (count, 3))

    rotations = np.array([exp_rotation(v) for v in rng.normal(size=(count, 3))])
    size = rng.uniform(0.1, 1.5, (count, 3))
    corners = position()[:, None] + rng.normal(size=(count, 3, 3))
    start = position()
    return Surfaces.joined(
        [
            boxes(position(), size, SurfaceClass.BUILDING, rotations=rotations),
            ellipsoids(position(), size, SurfaceClass.SHRUB, rotations=rotations),
            cones(start, start + rng.normal(size=(count, 3)), 0.3, 0.1, SurfaceClass.POLE),
            discs(position(), rotations[:, 2], size[:, :2], SurfaceClass.FOLIAGE),
            triangles(corners, SurfaceClass.GRASS),
        ]
    )


def _rays(rng, count):
    directions = rng.normal(size=(count, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return rng.uniform(-12, 12, (count, 3)), directions


@pytest.mark.slow
def test_the_tree_finds_the_nearest_of_all_surfaces():
    rng = np.random.default_rng(5)
    world = World.of(_many(rng, 60))
    surfaces = world.surfaces
    origins, directions = _rays(rng, 60)
    hits = world.cast(origins, directions, 0.0, np.zeros(60), 900.0)
    for i in range(60):
        distances = [
            reference.crossing(_KINDS[kind], row, origins[i], directions[i])
            for kind, row in zip(surfaces.kinds, surfaces.rows, strict=True)
        ]
        nearest = int(np.argmin(distances))
        assert hits.distances[i] == pytest.approx(distances[nearest], abs=1e-6)
        label = surfaces.labels[nearest] if np.isfinite(distances[nearest]) else NOTHING
        assert hits.labels[i] == label
    assert 10 < np.isfinite(hits.distances).sum() < 60


def test_surfaces_beyond_the_maximum_distance_are_not_hit():
    wall = boxes([10.0, 0, 0], [1.0, 5, 5], SurfaceClass.BUILDING)
    ahead = np.array([1.0, 0, 0])
    assert _cast_one(wall, np.zeros(3), ahead, max_distance=9.5)[0] == 9.0
    assert _cast_one(wall, np.zeros(3), ahead, max_distance=8.5)[0] == np.inf


@pytest.mark.parametrize("axis", range(3))
def test_rays_along_the_faces_of_a_tree_box_hit_surfaces(axis):
    # Zero components of the direction, with origins exactly on bounds, can give 0 * inf.
    blocks = boxes(np.mgrid[0:3, 0:3, 0:3].reshape(3, -1).T * 4.0, [1, 1, 1], SurfaceClass.FENCE)
    direction = np.eye(3)[axis]
    origin = np.full(3, 4.0)
    origin[axis] = -10.0
    assert _cast_one(blocks, origin, direction)[0] == 9.0


def test_moving_surfaces_are_hit_at_their_position_at_the_time_of_the_ray():
    rng = np.random.default_rng(9)
    shapes = [_many(rng, 2), _many(rng, 3)]
    poses = [Pose(exp_rotation(rng.normal(size=3)), rng.normal(size=3)) for _ in shapes]
    velocities = rng.normal(size=(2, 3)) * 10
    radii = [1e3, 1e3]
    frames = np.array(
        [
            np.concatenate([pose.translation, pose.rotation.T.ravel(), velocity, [radius]])
            for pose, velocity, radius in zip(poses, velocities, radii, strict=True)
        ]
    )
    surfaces = Surfaces.joined(shapes)
    first = np.array([0, len(shapes[0]), len(surfaces)])
    origins, directions = _rays(rng, 200)
    times = rng.uniform(-1, 1, 200)
    distances, cosines, rows = cast_at_movers(
        origins,
        directions,
        times,
        np.full(200, 900.0),
        surfaces.kinds,
        surfaces.rows,
        first,
        frames,
    )
    for i in range(200):
        best = np.inf, 0.0
        for shape, pose, velocity in zip(shapes, poses, velocities, strict=True):
            moved = shape.moved(Pose(pose.rotation, pose.translation + times[i] * velocity))
            best = min(best, _cast_one(moved, origins[i], directions[i]))
        assert distances[i] == pytest.approx(best[0], abs=1e-9)
        assert cosines[i] == pytest.approx(best[1], abs=1e-9)
        assert (rows[i] == NOTHING) == np.isinf(best[0])


@given(data=st.data())
def test_the_bounding_sphere_of_a_mover_changes_no_distance(data):
    origin, direction = data.draw(_ray(np.zeros(3), 0.5))
    block = boxes([0, 0, 0], [1.0, 2, 3], SurfaceClass.CAR)
    found = []
    for radius in (np.linalg.norm([1, 2, 3]) + 1e-9, 1e3):
        frame = np.concatenate([np.zeros(3), np.eye(3).ravel(), np.zeros(3), [radius]])
        found.append(
            cast_at_movers(
                origin[None], direction[None], np.zeros(1), np.full(1, 900.0),
                block.kinds, block.rows, np.array([0, 1]), frame[None],
            )[0][0]
        )  # fmt: skip
    assert found[0] == found[1]


def test_no_rays_and_no_surfaces_give_no_hits():
    empty_world = World.of()
    no_hits = empty_world.cast(np.empty((0, 3)), np.empty((0, 3)), 0.0, np.empty(0), 10.0)
    assert [
        len(a) for a in (no_hits.distances, no_hits.cosines, no_hits.labels, no_hits.losses)
    ] == [0] * 4
    one = empty_world.cast(np.zeros((1, 3)), np.array([[1.0, 0, 0]]), 0.0, np.zeros(1), 10.0)
    assert (one.distances[0], one.cosines[0], one.labels[0], one.objects[0]) == (np.inf, 0, -1, -1)


def test_every_world_has_one_compiled_signature():
    rng = np.random.default_rng(1)
    origins, directions = _rays(rng, 10)
    for surfaces in ((), _many(rng, 1), [_many(rng, 2), _many(rng, 1)]):
        World.of(surfaces).cast(origins, directions, 0.0, np.zeros(10), 50.0)
    if hasattr(cast_rays, "signatures"):
        assert len(cast_rays.signatures) <= 1
