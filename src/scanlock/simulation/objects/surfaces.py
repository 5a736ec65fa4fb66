"""Arrays of simple surfaces, built by the functions of `scanlock.simulation.objects.shapes`."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scanlock.arrays import Labels, Matrix, Vector, frozen, read_only
from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.kernels.simulation.ray_casting import BOX, CONE, DISC, ELLIPSOID, TRIANGLE

COLUMNS = 15
"""Number of parameters of a surface: centre, rotation and sizes."""

_BOUNDS_MARGIN = 1e-6
"""Margin of bounding boxes [m], so that rounding leaves no flat surface outside its box."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Surfaces:
    """Simple surfaces, each with a class and the number of its object.

    Attributes
    ----------
    kinds : (n,)
        Shapes, as numbered in `scanlock.kernels.simulation.ray_casting`.
    rows : (n, 15) [m]
        Centre, rotation from the world to the axes of the surface, and sizes.
    labels : (n,)
        `SurfaceClass` of each surface.
    objects : (n,)
        Object number of each surface.
    losses : (n,)
        Ratio of pulses that a surface does not return, as glass and black paint.

    Raises
    ------
    InvalidInput
        Arrays of inconsistent shapes.
    """

    kinds: Labels
    rows: Matrix
    labels: Labels
    objects: Labels
    losses: Vector

    def __post_init__(self) -> None:
        n = len(self.kinds)
        for name, shape, kind in (
            ("kinds", (n,), np.int64),
            ("rows", (n, COLUMNS), np.float64),
            ("labels", (n,), np.int64),
            ("objects", (n,), np.int64),
            ("losses", (n,), np.float64),
        ):
            array = np.asarray(getattr(self, name), kind)
            if array.shape != shape:
                raise InvalidInput(f"{name} must have shape {shape}, got {array.shape}")
            object.__setattr__(self, name, read_only(array))

    @classmethod
    def _of(
        cls, kinds: Labels, rows: Matrix, labels: Labels, objects: Labels, losses: Vector
    ) -> "Surfaces":
        """Return surfaces of valid, contiguous arrays, without checks: a scene has thousands."""
        made = object.__new__(cls)
        for name, array in (
            ("kinds", kinds),
            ("rows", rows),
            ("labels", labels),
            ("objects", objects),
            ("losses", losses),
        ):
            frozen(array)
            object.__setattr__(made, name, array)
        return made

    @classmethod
    def none(cls) -> "Surfaces":
        """Return an empty set of surfaces."""
        empty = np.empty(0, np.int64)
        return cls(
            kinds=empty,
            rows=np.empty((0, COLUMNS)),
            labels=empty,
            objects=empty,
            losses=np.empty(0),
        )

    @classmethod
    def joined(cls, parts: "Iterable[Surfaces]") -> "Surfaces":
        """Concatenate the surfaces of all parts."""
        parts = [*parts] or [cls.none()]
        return cls._of(
            kinds=np.concatenate([part.kinds for part in parts]),
            rows=np.concatenate([part.rows for part in parts]),
            labels=np.concatenate([part.labels for part in parts]),
            objects=np.concatenate([part.objects for part in parts]),
            losses=np.concatenate([part.losses for part in parts]),
        )

    def __len__(self) -> int:
        return len(self.kinds)

    def taken(self, index: NDArray[Any]) -> "Surfaces":
        """Return the surfaces at an index array or mask."""
        return Surfaces(
            kinds=self.kinds[index],
            rows=self.rows[index],
            labels=self.labels[index],
            objects=self.objects[index],
            losses=self.losses[index],
        )

    def moved(self, pose: Pose) -> "Surfaces":
        """Return the surfaces after a rigid motion."""
        rows = np.empty_like(self.rows)
        rows[:, :3] = pose.apply(self.rows[:, :3])
        rotations = self.rows[:, 3:12].reshape(-1, 3, 3) @ pose.rotation.T
        rows[:, 3:12] = rotations.reshape(-1, 9)
        rows[:, 12:] = self.rows[:, 12:]
        return self._of(self.kinds, rows, self.labels, self.objects, self.losses)

    def as_object(self, number: int) -> "Surfaces":
        """Return the surfaces with the number of one object."""
        objects = np.full(len(self), number, np.int64)
        return self._of(self.kinds, self.rows, self.labels, objects, self.losses)

    def bounds(self) -> Matrix:
        """Return the (n, 6) axis-aligned bounding boxes: low x, y, z and high x, y, z [m]."""
        centres = self.rows[:, :3]
        # Column j of `axes[i]` is axis j of surface i.
        axes = self.rows[:, 3:12].reshape(-1, 3, 3).transpose(0, 2, 1)
        sizes = self.rows[:, 12:]
        low = np.empty_like(centres)
        high = np.empty_like(centres)
        for kind, extent in (
            (BOX, _box_extent),
            (ELLIPSOID, _ellipsoid_extent),
            (DISC, _disc_extent),
            (CONE, _cone_extent),
            (TRIANGLE, _triangle_extent),
        ):
            chosen = self.kinds == kind
            if chosen.any():
                below, above = extent(axes[chosen], sizes[chosen])
                low[chosen] = centres[chosen] + below
                high[chosen] = centres[chosen] + above
        return np.column_stack([low - _BOUNDS_MARGIN, high + _BOUNDS_MARGIN])


def _box_extent(axes: NDArray[np.float64], sizes: Matrix) -> tuple[Matrix, Matrix]:
    half = np.einsum("nij,nj->ni", np.abs(axes), sizes)
    return -half, half


def _ellipsoid_extent(axes: NDArray[np.float64], sizes: Matrix) -> tuple[Matrix, Matrix]:
    half = np.sqrt(np.einsum("nij,nj->ni", axes**2, sizes**2))
    return -half, half


def _disc_extent(axes: NDArray[np.float64], sizes: Matrix) -> tuple[Matrix, Matrix]:
    half = np.sqrt(np.einsum("nij,nj->ni", axes[:, :, :2] ** 2, sizes[:, :2] ** 2))
    return -half, half


def _cone_extent(axes: NDArray[np.float64], sizes: Matrix) -> tuple[Matrix, Matrix]:
    direction = axes[:, :, 2]
    across = np.sqrt(np.maximum(1.0 - direction**2, 0.0))
    end = direction * sizes[:, 2:]
    bottom, top = across * sizes[:, :1], across * sizes[:, 1:2]
    return np.minimum(-end - bottom, end - top), np.maximum(-end + bottom, end + top)


def _triangle_extent(axes: NDArray[np.float64], sizes: Matrix) -> tuple[Matrix, Matrix]:
    second = axes[:, :, 0] * sizes[:, :1]
    third = axes[:, :, 0] * sizes[:, 1:2] + axes[:, :, 1] * sizes[:, 2:]
    corners = np.stack([np.zeros_like(second), second, third])
    return corners.min(axis=0), corners.max(axis=0)
