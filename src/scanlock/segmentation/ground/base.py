"""The coarse ground: a surface of planar patches that needs no sensor height and no flat earth.

It is the mean function of the Gaussian processes, so that these model what is left over: a
hillside or an embankment is not a deviation of metres from one plane.
"""

from dataclasses import dataclass

import numpy as np

from scanlock.arrays import Mask, Points, Vector, frozen, read_only
from scanlock.clouds.polar_grid import PolarGrid
from scanlock.kernels.ground.envelope import lower_envelope
from scanlock.kernels.ground.model import heights_of_patches, patch_members, prototype_patches
from scanlock.kernels.ground.patches import grow_patches
from scanlock.kernels.ground.point_passes import sharp_prototypes
from scanlock.segmentation.ground.plane import BasePlane
from scanlock.segmentation.ground.prototypes import Prototypes

# All numbers of this file are ours.

_SHARP_HEIGHT, _SHARP_SLOPE = 0.25, 0.15
"""A point is close to the lowest of its cell within the first [m], plus the second times the
width of the cell."""

_SHARP_REACH = 3.0
_SHARP_SHARE = 0.6
"""A cell is sharp when this share of its points within the reach, times closeness, is close: a
wall goes on above its foot, a floor does not, and a tree leaves a gap."""

_STEEPEST = 0.6
"""Slope of the steepest ground; what stands higher above lower ground nearby is an object."""

_ENVELOPE_LIMIT = 0.25
"""Ground lies within this height of the lower envelope [m]."""

_SUPPORT, _SLACK = 3, 0.1
"""A low point tells what stands above it only if so many around it lie about as low: within the
second [m], plus half of the steepest slope."""

_PATCH_SECTORS = 30
_FIRST_RING, _RING_GROWTH = 2.0, 1.22
"""Patches about as deep as wide: 12 degrees, and rings that grow by a fifth from 2 m on."""

_GATE, _GATE_SLOPE = 0.3, 0.35
"""A low point fits a prediction within the first [m], plus the second times the distance from
the ground that predicts it [m]."""

_START_SHARE, _START_COUNT = 0.6, 3
"""A patch starts the growth if this share of its low points, this many at least, lie on the base
plane."""

_PRIOR_WEIGHT = 2.0
_SLOPE_DEVIATION = 0.15
_POINT_DEVIATION = 0.1
"""A prediction counts as so many low points, each of the last deviation [m]; slopes change by
about the second from patch to patch."""

_ROUGHNESS = 0.15
"""Largest standard deviation of the low points of a patch about its plane [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class BaseSurface:
    """The coarse ground at the prototypes of a scan.

    Attributes
    ----------
    height : (n,) [m]
        Height of the coarse ground above the base plane at each prototype; NaN away from it.
    sharp : (n,)
        Cells whose points lie flat at their lowest end.
    on_envelope : (n,)
        Prototypes that do not stand above lower ones nearby.
    """

    height: Vector
    sharp: Mask
    on_envelope: Mask

    def __post_init__(self) -> None:
        for array in (self.height, self.sharp, self.on_envelope):
            frozen(array)


def fit_base_surface(
    points: Points, prototypes: Prototypes, plane: BasePlane, grid: PolarGrid
) -> BaseSurface:
    """Return the coarse ground that grows from the base plane, patch by patch."""
    heights = plane.heights(prototypes.points)
    x, y, z = (
        read_only(column) for column in (prototypes.points[:, 0], prototypes.points[:, 1], heights)
    )
    sharp = sharp_prototypes(
        read_only(points),
        prototypes.cell_of_point,
        prototypes.points,
        prototypes.cells,
        plane.coefficients,
        read_only(_SHARP_HEIGHT + _SHARP_SLOPE * np.diff(grid.edges)),
        _SHARP_REACH,
        _SHARP_SHARE,
    )
    envelope = lower_envelope(
        x, y, z, prototypes.cells, prototypes.starts, prototypes.bins, _STEEPEST, _SLACK, _SUPPORT
    )
    # Reflections below the ground must not take the ground around them away.
    on_plane = np.abs(heights) < _GATE
    on_envelope = (heights - envelope < _ENVELOPE_LIMIT) | on_plane
    return BaseSurface(
        _patched_heights(x, y, z, sharp & on_envelope, on_plane, prototypes), sharp, on_envelope
    )


def _patched_heights(
    x: Vector, y: Vector, z: Vector, firm: Mask, on_plane: Mask, prototypes: Prototypes
) -> Vector:
    """Return the height of the coarse ground at each prototype from the patches of the firm."""
    sectors = min(_PATCH_SECTORS, len(prototypes.starts) - 1)
    patch, rings = prototype_patches(
        prototypes.ranges, prototypes.starts, sectors, _FIRST_RING, _RING_GROWTH
    )
    members, first, occupied, start = patch_members(
        read_only(patch),
        sectors * rings,
        read_only(firm),
        read_only(on_plane),
        _START_SHARE,
        _START_COUNT,
    )
    patches, accepted = grow_patches(
        x,
        y,
        z,
        read_only(members),
        read_only(first),
        read_only(occupied),
        read_only(start),
        sectors,
        rings,
        _GATE,
        _GATE_SLOPE,
        _PRIOR_WEIGHT,
        _PRIOR_WEIGHT * (_POINT_DEVIATION / _SLOPE_DEVIATION) ** 2,
        _ROUGHNESS,
    )
    return heights_of_patches(
        x, y, read_only(patch), read_only(patches), read_only(accepted), sectors, rings
    )
