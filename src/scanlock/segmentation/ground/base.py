"""Base surface: a coarse ground model of planar patches that requires no sensor height.

It is the mean function of the Gaussian processes, which therefore model only the residual relief.
Without it a hillside or an embankment would deviate by metres from the base plane.
"""

from dataclasses import dataclass

import numpy as np

from scanlock.arrays import Mask, Points, Vector, frozen, read_only
from scanlock.clouds.polar_grid import PolarGrid
from scanlock.kernels.ground.envelope import lower_envelope
from scanlock.kernels.ground.model import blended_patch_heights, patch_members, prototype_patches
from scanlock.kernels.ground.patches import grow_patches
from scanlock.kernels.ground.point_passes import sharp_prototypes
from scanlock.segmentation.ground.plane import BasePlane
from scanlock.segmentation.ground.prototypes import Prototypes

# All constants of this file are ours.

_SHARP_HEIGHT, _SHARP_SLOPE = 0.25, 0.15
"""Close height of a cell [m], and its increase per metre of the width of the bin."""

_SHARP_FACTOR = 3.0
_SHARP_FRACTION = 0.6
"""A cell is sharp if this fraction of its low points is within the close height of its lowest one.

Low points are those within `_SHARP_FACTOR` close heights. A floor is sharp; a wall extends above
its foot, and a tree has a gap below its crown.
"""

_MAX_SLOPE = 0.6
"""Largest slope of the ground; points further above lower ground nearby are objects."""

_ENVELOPE_THRESHOLD = 0.25
"""Height above the lower envelope below which a prototype may be ground [m]."""

_MIN_ENVELOPE_SUPPORT, _ENVELOPE_SLACK = 3, 0.1
"""Minimum number of prototypes about as low around a prototype that shapes the envelope.

As low means within `_ENVELOPE_SLACK` [m] plus half of the largest slope.
"""

_PATCH_SECTORS = 30
_FIRST_RING, _RING_GROWTH = 2.0, 1.22
"""Sectors and rings of patches, about as deep as wide: 12 degrees, rings that grow from 2 m on."""

_THRESHOLD, _THRESHOLD_SLOPE = 0.3, 0.35
"""Threshold of a prototype's residual to a predicted plane [m], and its increase per metre.

The distance is that from the patches that predict the plane.
"""

_START_FRACTION, _MIN_START_COUNT = 0.6, 3
"""Minimum fraction and number of the prototypes of an initial patch that lie on the base plane."""

_PRIOR_WEIGHT = 2.0
_SLOPE_DEVIATION = 0.15
_POINT_DEVIATION = 0.1
"""Weight of a prediction as a number of prototypes, and deviation of each of them [m].

The slope of a patch differs from the prediction by about `_SLOPE_DEVIATION`.
"""

_MAX_ROUGHNESS = 0.15
"""Largest standard deviation of the prototypes of a patch about its plane [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class BaseSurface:
    """Coarse ground model at the prototypes of a scan.

    Attributes
    ----------
    height : (n,) [m]
        Height of the surface above the base plane at each prototype; NaN outside the patches.
    sharp : (n,)
        Cells without upright structure: most of their points are close to the lowest one.
    on_envelope : (n,)
        Prototypes on the lower envelope of the prototypes.
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
    """Fit the base surface by growing planar patches from the base plane.

    Parameters
    ----------
    points : (m, 3) [m]
        Levelled points.
    prototypes : Prototypes
        Lowest points of the cells.
    plane : BasePlane
        Plane through the initial patches.
    grid : PolarGrid
        Grid of the prototypes.
    """
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
        _SHARP_FACTOR,
        _SHARP_FRACTION,
    )
    envelope = lower_envelope(
        x,
        y,
        z,
        prototypes.cells,
        prototypes.starts,
        prototypes.bins,
        _MAX_SLOPE,
        _ENVELOPE_SLACK,
        _MIN_ENVELOPE_SUPPORT,
    )
    # Reflections below the ground must not exclude the ground around them.
    on_plane = np.abs(heights) < _THRESHOLD
    on_envelope = (heights - envelope < _ENVELOPE_THRESHOLD) | on_plane
    return BaseSurface(
        _patch_heights(x, y, z, sharp & on_envelope, on_plane, prototypes), sharp, on_envelope
    )


def _patch_heights(
    x: Vector, y: Vector, z: Vector, candidates: Mask, on_plane: Mask, prototypes: Prototypes
) -> Vector:
    """Return the height of patches at each prototype; they are fitted to the candidates."""
    sectors = min(_PATCH_SECTORS, len(prototypes.starts) - 1)
    patch, rings = prototype_patches(
        prototypes.ranges, prototypes.starts, sectors, _FIRST_RING, _RING_GROWTH
    )
    members, first, occupied, start = patch_members(
        read_only(patch),
        sectors * rings,
        read_only(candidates),
        read_only(on_plane),
        _START_FRACTION,
        _MIN_START_COUNT,
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
        _THRESHOLD,
        _THRESHOLD_SLOPE,
        _PRIOR_WEIGHT,
        _PRIOR_WEIGHT * (_POINT_DEVIATION / _SLOPE_DEVIATION) ** 2,
        _MAX_ROUGHNESS,
    )
    return blended_patch_heights(
        x, y, read_only(patch), read_only(patches), read_only(accepted), sectors, rings
    )
