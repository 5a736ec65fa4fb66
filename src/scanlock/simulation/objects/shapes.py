"""Boxes, cones, ellipsoids, discs and triangles, of which simulated objects consist.

All functions take lengths in metres with one row per shape, and broadcast single values. `loss` is
the ratio of pulses that a shape does not return, as for a window. The object number of the new
surfaces is 0; see `Surfaces.as_object`.

All functions raise `InvalidInput` for sizes that are not positive, coordinates that are not finite,
or a loss outside of [0, 1].
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from scanlock.arrays import Matrix
from scanlock.errors import InvalidInput, require_fraction
from scanlock.kernels.simulation.ray_casting import BOX, CONE, DISC, ELLIPSOID, TRIANGLE
from scanlock.simulation.objects.surface_class import SurfaceClass
from scanlock.simulation.objects.surfaces import COLUMNS, Surfaces


def boxes(
    centres: ArrayLike,
    half_sizes: ArrayLike,
    label: SurfaceClass,
    *,
    rotations: ArrayLike | None = None,
    loss: float = 0.0,
) -> Surfaces:
    """Return boxes.

    Parameters
    ----------
    centres, half_sizes : (n, 3) [m]
    label : SurfaceClass
    rotations : (n, 3, 3), optional
        Rotations from the axes of each box to those of its surroundings.
    loss : float
        Ratio of pulses that are not returned.

    Returns
    -------
    Surfaces
        One surface per row.
    """
    _require_positive("half_sizes", half_sizes)
    return _surfaces(BOX, centres, half_sizes, label, rotations, loss)


def blocks(
    spans: Sequence[tuple[float, float, float, float, float, float]],
    label: SurfaceClass,
    *,
    loss: float = 0.0,
) -> Surfaces:
    """Return axis-aligned boxes between two corners; blocks without thickness are omitted.

    Parameters
    ----------
    spans : sequence of tuple [m]
        Low and high x, low and high y, low and high z of each block.
    label, loss
        As for `boxes`.

    Returns
    -------
    Surfaces
        One surface per block with a thickness.
    """
    corners = np.array(spans, np.float64).reshape(-1, 6)
    low, high = corners[:, ::2], corners[:, 1::2]
    solid = (high > low).all(axis=1)
    half = 0.5 * (high - low)[solid]
    return boxes(low[solid] + half, half, label, loss=loss)


def ellipsoids(
    centres: ArrayLike,
    half_axes: ArrayLike,
    label: SurfaceClass,
    *,
    rotations: ArrayLike | None = None,
    loss: float = 0.0,
) -> Surfaces:
    """Return ellipsoids.

    Parameters
    ----------
    centres, half_axes : (n, 3) [m]
    label, rotations, loss
        As for `boxes`.

    Returns
    -------
    Surfaces
        One surface per row.
    """
    _require_positive("half_axes", half_axes)
    return _surfaces(ELLIPSOID, centres, half_axes, label, rotations, loss)


def cones(
    bottoms: ArrayLike,
    tops: ArrayLike,
    bottom_radii: ArrayLike,
    top_radii: ArrayLike,
    label: SurfaceClass,
    *,
    loss: float = 0.0,
) -> Surfaces:
    """Return closed, possibly truncated cones, or cylinders.

    Parameters
    ----------
    bottoms, tops : (n, 3) [m]
        Centres of both ends.
    bottom_radii, top_radii : (n,) [m]
        One of the two may be zero.
    label, loss
        As for `boxes`.

    Returns
    -------
    Surfaces
        One surface per row.
    """
    bottoms = np.atleast_2d(np.asarray(bottoms, np.float64))
    axes = np.atleast_2d(np.asarray(tops, np.float64)) - bottoms
    lengths = np.linalg.norm(axes, axis=1)
    if not (lengths > 0).all():
        raise InvalidInput("the two ends of a cone must be finite and distinct")
    sizes = np.empty((len(axes), 3))
    sizes[:, 0], sizes[:, 1], sizes[:, 2] = bottom_radii, top_radii, 0.5 * lengths
    _require_positive("the larger radius of a cone", np.maximum(sizes[:, 0], sizes[:, 1]))
    if (sizes[:, :2] < 0).any():
        raise InvalidInput(f"radii of a cone must not be negative, got {sizes[:, :2].min()} m")
    frames = _frames_along(axes / lengths[:, None])
    return _surfaces(CONE, bottoms + 0.5 * axes, sizes, label, frames, loss)


def discs(
    centres: ArrayLike,
    normals: ArrayLike,
    radii: ArrayLike,
    label: SurfaceClass,
    *,
    loss: float = 0.0,
) -> Surfaces:
    """Return flat discs or ellipses.

    Parameters
    ----------
    centres : (n, 3) [m]
    normals : (n, 3)
        Normals of any length.
    radii : (n,) or (n, 2) [m]
        Radii of discs, or half axes of ellipses.
    label, loss
        As for `boxes`.

    Returns
    -------
    Surfaces
        One surface per row.
    """
    normals = np.atleast_2d(np.asarray(normals, np.float64))
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    _require_positive("the length of a normal", lengths)
    radii = np.asarray(radii, np.float64)
    _require_positive("radii", radii)
    sizes = np.ones((len(normals), 3))
    sizes[:, :2] = radii if radii.ndim == 2 else radii[..., None]
    return _surfaces(DISC, centres, sizes, label, _frames_along(normals / lengths), loss)


def triangles(corners: ArrayLike, label: SurfaceClass, *, loss: float = 0.0) -> Surfaces:
    """Return flat triangles.

    Parameters
    ----------
    corners : (n, 3, 3) [m]
        Three corners in rows, not collinear.
    label, loss
        As for `boxes`.

    Returns
    -------
    Surfaces
        One surface per row.
    """
    corners = np.asarray(corners, np.float64).reshape(-1, 3, 3)
    first = corners[:, 1] - corners[:, 0]
    second = corners[:, 2] - corners[:, 0]
    length = np.linalg.norm(first, axis=1)
    across = np.cross(first, second)
    double_area = np.linalg.norm(across, axis=1)
    if not (double_area > 0).all():
        raise InvalidInput("the corners of a triangle must be finite and not collinear")
    x = first / length[:, None]
    z = across / double_area[:, None]
    y = np.cross(z, x)
    sizes = np.column_stack(
        [length, np.einsum("ij,ij->i", second, x), np.einsum("ij,ij->i", second, y)]
    )
    return _surfaces(TRIANGLE, corners[:, 0], sizes, label, np.stack([x, y, z], axis=2), loss)


def _surfaces(
    kind: int,
    centres: ArrayLike,
    sizes: ArrayLike,
    label: SurfaceClass,
    rotations: ArrayLike | None,
    loss: float,
) -> Surfaces:
    require_fraction("loss", loss)
    centres = np.atleast_2d(np.asarray(centres, np.float64))
    n = len(centres)
    rows = np.empty((n, COLUMNS))
    rows[:, :3] = centres
    axes = np.eye(3) if rotations is None else np.asarray(rotations, np.float64)
    rows[:, 3:12] = axes.swapaxes(-1, -2).reshape(-1, 9)
    rows[:, 12:] = np.asarray(sizes, np.float64)
    if not np.isfinite(rows).all():
        raise InvalidInput("centres, sizes and rotations of surfaces must be finite")
    return Surfaces(
        kinds=np.full(n, kind),
        rows=rows,
        labels=np.full(n, int(label)),
        objects=np.zeros(n, np.int64),
        losses=np.full(n, float(loss)),
    )


def _require_positive(name: str, values: ArrayLike) -> None:
    values = np.asarray(values, np.float64)
    if not (values > 0).all():
        raise InvalidInput(f"{name} must be positive, got {values[~(values > 0)][0]} m")


def _frames_along(directions: Matrix) -> NDArray[np.float64]:
    """Return (n, 3, 3) rotations with the unit directions as third column."""
    a, b, c = directions.T
    frames = np.empty((len(directions), 3, 3))
    x, y = frames[:, :, 0], frames[:, :, 1]
    # Perpendicular to the direction and to z, or to x where the direction is near z.
    steep = np.abs(c) > 0.9
    x[:, 0], x[:, 1], x[:, 2] = -b, a, 0.0
    x[steep, 0], x[steep, 1], x[steep, 2] = 0.0, -c[steep], b[steep]
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    p, q, r = x.T
    y[:, 0], y[:, 1], y[:, 2] = b * r - c * q, c * p - a * r, a * q - b * p
    frames[:, :, 2] = directions
    return frames
