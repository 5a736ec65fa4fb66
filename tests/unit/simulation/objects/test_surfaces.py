import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from reference import ray_casting as reference
from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import exp_rotation
from scanlock.simulation.objects.shapes import boxes, cones, discs, ellipsoids, triangles
from scanlock.simulation.objects.surface_class import SurfaceClass
from scanlock.simulation.objects.surfaces import Surfaces

_vectors = arrays(np.float64, 3, elements=st.floats(-5, 5))
_POLE = SurfaceClass.POLE


def _one_of_each(rng):
    turn = exp_rotation(rng.normal(size=3))
    size = rng.uniform(0.2, 2.0, 3)
    centre = rng.normal(size=(6, 3)) * 3
    return {
        "box": boxes(centre[0], size, _POLE, rotations=turn),
        "ellipsoid": ellipsoids(centre[1], size, _POLE, rotations=turn),
        "cone": cones(centre[2], centre[3], size[0], size[1], _POLE),
        "disc": discs(centre[4], turn[:, 2], size[None, :2], _POLE),
        "triangle": triangles(centre[5] + rng.normal(size=(3, 3)), _POLE),
    }


def _points_on(kind, row, rng, count=4000):
    """Points on a surface: zeros of its gauge along random directions from its centre."""
    a, b, c = row[12:]
    if kind == "triangle":
        u, v = np.sort(rng.random((2, count)), axis=0)
        corners = np.array([[0, 0, 0], [a, 0, 0], [b, c, 0]])
        local = np.column_stack([u, v - u, 1 - v]) @ corners
    elif kind == "disc":
        angle, share = rng.uniform(0, 2 * np.pi, count), np.sqrt(rng.random(count))
        local = np.column_stack([a * share * np.cos(angle), b * share * np.sin(angle), 0 * angle])
    else:
        directions = rng.normal(size=(count, 3))
        low, high = np.zeros(count), np.full(count, 20.0)
        for _ in range(60):
            middle = (low + high) / 2
            inside = reference.gauge(kind, row[12:], directions * middle[:, None]) <= 0
            low, high = np.where(inside, middle, low), np.where(inside, high, middle)
        local = directions * low[:, None]
    return row[:3] + local @ row[3:12].reshape(3, 3)


@pytest.mark.parametrize("kind", ["box", "ellipsoid", "cone", "disc", "triangle"])
@pytest.mark.parametrize("seed", range(4))
def test_bounds_enclose_a_surface_tightly(kind, seed):
    rng = np.random.default_rng(seed)
    surface = _one_of_each(rng)[kind]
    points = _points_on(kind, surface.rows[0], rng)
    low, high = surface.bounds()[0, :3], surface.bounds()[0, 3:]
    assert (points >= low).all()
    assert (points <= high).all()
    assert (points.min(axis=0) - low < 0.12 * (high - low) + 1e-3).all()
    assert (high - points.max(axis=0) < 0.12 * (high - low) + 1e-3).all()


@pytest.mark.slow
@given(a=_vectors, b=_vectors, c=_vectors)
def test_a_triangle_has_its_given_corners(a, b, c):
    if np.linalg.norm(np.cross(b - a, c - a)) < 1e-3:
        return
    row = triangles([[a, b, c]], _POLE).rows[0]
    local = np.array([[0, 0, 0], [row[12], 0, 0], [row[13], row[14], 0]])
    np.testing.assert_allclose(row[:3] + local @ row[3:12].reshape(3, 3), [a, b, c], atol=1e-9)


@given(direction=_vectors)
def test_a_cone_extends_from_its_bottom_to_its_top(direction):
    if np.linalg.norm(direction) < 1e-3:
        return
    bottom = np.array([1.0, 2, 3])
    top = bottom + direction
    row = cones(bottom, top, 0.5, 0.2, _POLE).rows[0]
    frame = row[3:12].reshape(3, 3)
    np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-9)
    np.testing.assert_allclose(row[:3] - row[14] * frame[2], bottom, atol=1e-9)
    np.testing.assert_allclose(row[:3] + row[14] * frame[2], top, atol=1e-9)


@pytest.mark.parametrize("kind", ["box", "ellipsoid", "cone", "disc", "triangle"])
def test_a_moved_surface_contains_the_moved_points(kind):
    rng = np.random.default_rng(7)
    surface = _one_of_each(rng)[kind]
    pose = Pose(exp_rotation(rng.normal(size=3)), rng.normal(size=3) * 5)
    moved = surface.moved(pose)
    before, after = surface.rows[0], moved.rows[0]
    points = _points_on(kind, before, rng, 50)
    np.testing.assert_allclose(
        reference.to_local(after, pose.apply(points)), reference.to_local(before, points), atol=1e-9
    )
    np.testing.assert_array_equal(after[12:], before[12:])


def test_joined_surfaces_keep_their_order_classes_objects_and_losses():
    first = boxes(np.zeros((2, 3)), [1, 1, 1], SurfaceClass.CAR, loss=0.25).as_object(4)
    second = discs([0.0, 0, 0], [0.0, 0, 2], 0.5, SurfaceClass.FOLIAGE).as_object(9)
    both = Surfaces.joined([first, Surfaces.none(), second])
    assert both.labels.tolist() == [SurfaceClass.CAR, SurfaceClass.CAR, SurfaceClass.FOLIAGE]
    assert both.objects.tolist() == [4, 4, 9]
    assert both.losses.tolist() == [0.25, 0.25, 0.0]
    assert len(both) == 3
    assert both.taken(np.array([2])).objects.tolist() == [9]
    assert len(Surfaces.joined([])) == 0


def test_arrays_of_surfaces_are_read_only_copies():
    kinds, rows, zeros = np.zeros(1, np.int64), np.ones((1, 15)), np.zeros(1)
    surfaces = Surfaces(kinds=kinds, rows=rows, labels=kinds, objects=kinds, losses=zeros)
    for array in (surfaces.kinds, surfaces.rows, surfaces.labels, surfaces.losses):
        assert not array.flags.writeable
    assert rows.flags.writeable


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: boxes([0, 0, 0], [1, 0, 1], _POLE), "half_sizes must be positive, got 0.0 m"),
        (lambda: boxes([0, 0, np.inf], [1, 1, 1], _POLE), "must be finite"),
        (lambda: ellipsoids([0, 0, 0], [1, -1, 1], _POLE), "half_axes must be positive"),
        (lambda: ellipsoids([0, 0, 0], [1, np.nan, 1], _POLE), "half_axes must be positive"),
        (lambda: cones([0, 0, 0], [0, 0, 0], 1, 1, _POLE), "finite and distinct"),
        (lambda: cones([0, 0, 0], [0, 0, 1], 0, 0, _POLE), "larger radius of a cone"),
        (lambda: cones([0, 0, 0], [0, 0, 1], 1, -1, _POLE), "must not be negative, got -1.0 m"),
        (lambda: discs([0, 0, 0], [0, 0, 0], 1, _POLE), "length of a normal"),
        (lambda: discs([0, 0, 0], [0, 0, 1], 0, _POLE), "radii must be positive"),
        (lambda: triangles([[0, 0, 0], [1, 1, 1], [2, 2, 2]], _POLE), "finite and not collinear"),
        (lambda: boxes([0, 0, 0], [1, 1, 1], _POLE, loss=1.5), "loss must lie between 0 and 1"),
        (
            lambda: Surfaces(
                kinds=np.zeros(2),
                rows=np.zeros((1, 15)),
                labels=np.zeros(2),
                objects=np.zeros(2),
                losses=np.zeros(2),
            ),
            r"rows must have shape \(2, 15\), got \(1, 15\)",
        ),
    ],
)
def test_invalid_shapes_are_refused(make, message):
    with pytest.raises(InvalidInput, match=message):
        make()
