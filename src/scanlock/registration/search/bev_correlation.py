"""BEV correlation: exhaustive search over heading and horizontal translation by FFT.

Once both scans are level, the pose has three unknowns left: heading and horizontal translation.
For each heading, one correlation of the BEV grids gives the score of every translation, so the
search needs no initial pose and no feature matches. The spectra are partially whitened, between
plain correlation and the phase correlation of Kuglin and Hines 1975.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import cast

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from scanlock.arrays import Matrix, Vector, read_only
from scanlock.clouds.point_cloud import PointCloud
from scanlock.errors import InvalidInput, require_at_least, require_count, require_fraction
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import exp_rotation
from scanlock.kernels.search.rotated_grids import rotated_grids
from scanlock.registration.search.bev_grid import BevGrid, BevProjector
from scanlock.registration.search.ground_alignment import align_grounds
from scanlock.registration.search.hypothesis import Hypothesis
from scanlock.segmentation.ground.finder import Ground
from scanlock.threads import parallel_map

_Grids = NDArray[np.float32]
_Spectra = NDArray[np.complex64]

_RADIUS_CELLS = 30
"""Radius of a scan in the correlation grid [cells]; cells beyond it are left out."""

_GRID_SIZE = 96
"""Cells along a side of the correlation grid. Two scans with a radius of 30 cells do not wrap
around at translations of up to 36 cells."""

_CELL_SIZES = (0.5, 1.0, 2.0)
"""Sides of a correlation cell [m]: the smallest for which both scans fit, or else the last."""

_MIN_MAGNITUDE = 1e-6
"""Added to spectral magnitudes to avoid a division by zero."""

_SUPPRESSION_RADIUS = 2
"""Half-width of the non-maximum suppression around a peak, in headings and in cells."""


@dataclass(frozen=True, kw_only=True, slots=True)
class BevSearch:
    """Settings of the BEV correlation: `project` each scan once, then `hypotheses` of any pair."""

    projector: BevProjector = field(default_factory=BevProjector)
    """Settings of the BEV grid of each scan."""

    headings: int = 92
    """Number of headings, evenly around the circle; a multiple of four. Half a step, 2 degrees, is
    one cell at the radius of the grid."""

    free_cell_weight: float = 0.2
    """Weight of a free cell against a fully occupied one. Free cells correlate positively with
    each other, negatively with occupied cells."""

    whitening: float = 0.5
    """Exponent of the magnitude by which each spectrum is divided: 0 is plain correlation, 1 is
    phase correlation. Whitening favours posts and corners over slopes and thickets."""

    align_ground: bool = True
    """Whether to estimate height, roll and pitch of a hypothesis from the ground that both scans
    observed."""

    max_hypotheses: int = 8
    """Maximum number of hypotheses."""

    min_score_ratio: float = 0.5
    """Minimum score of a hypothesis as a fraction of the best score."""

    def __post_init__(self) -> None:
        require_count("headings", self.headings, 4)
        if self.headings % 4:
            raise InvalidInput(f"headings must be a multiple of four, got {self.headings}")
        require_at_least("free_cell_weight", self.free_cell_weight, 0.0)
        require_fraction("whitening", self.whitening)
        require_count("max_hypotheses", self.max_hypotheses, 1)
        require_fraction("min_score_ratio", self.min_score_ratio)

    def project(self, cloud: PointCloud, ground: Ground) -> BevGrid:
        """Compute the BEV grid of a cloud from the result of its ground segmentation."""
        return self.projector.project(cloud, ground)

    def hypotheses(self, target: BevGrid, source: BevGrid) -> list[Hypothesis]:
        """Return the poses at the peaks of the correlation, best first.

        Their scores are relative to the highest peak. The list is empty if either grid has no
        occupied cell.
        """
        if len(target.occupied_cells) == 0 or len(source.occupied_cells) == 0:
            return []
        cell_size = _cell_size(max(target.radius, source.radius))
        correlation = self._correlation(target, source, cell_size)
        hypotheses: list[Hypothesis] = []
        for heading, i, j, score in self._peaks(correlation):
            level = self._level_pose(heading, i, j, cell_size)
            pose = target.level_from_scan.inverse() @ level @ source.level_from_scan
            if self.align_ground:
                pose = align_grounds(target, source, pose)
            hypotheses.append(Hypothesis(pose=pose, score=score, proposed_by="BEV correlation"))
        return hypotheses

    def _correlation(self, target: BevGrid, source: BevGrid, cell_size: float) -> _Grids:
        """Return the (h, size, size) correlation at each heading and translation.

        Grids can be rotated by a right angle without resampling. The source is therefore rotated
        to the headings of the first quadrant, the target to the four right angles. Translations
        of quadrant q refer to a target rotated back by q right angles; they wrap around.
        """
        right_angles = np.linspace(0.0, -2.0 * math.pi, 4, endpoint=False)
        quadrant = np.linspace(0.0, 0.5 * math.pi, self.headings // 4, endpoint=False)
        target_spectra, source_spectra = parallel_map(
            lambda side: self._spectra(*side, cell_size),
            ((target, right_angles), (source, quadrant)),
        )
        source_spectra = source_spectra.conj()
        correlation = np.empty((4, len(quadrant), _GRID_SIZE, _GRID_SIZE), np.float32)

        def correlate(q: int) -> None:
            product = target_spectra[q] * source_spectra
            correlation[q] = cast(
                _Grids, fft.irfft2(product, s=(_GRID_SIZE, _GRID_SIZE), overwrite_x=True)
            )

        # One quadrant at a time fits into the cache.
        parallel_map(correlate, range(4))
        return correlation.reshape(self.headings, _GRID_SIZE, _GRID_SIZE)

    def _spectra(self, grid: BevGrid, headings: Vector, cell_size: float) -> _Spectra:
        """Return the whitened spectra of a BEV grid rotated to each heading."""
        rotated = rotated_grids(
            *_cells_within(grid, cell_size * _RADIUS_CELLS),
            self.free_cell_weight,
            read_only(headings),
            cell_size,
            _GRID_SIZE,
        )
        # The stubs of SciPy do not know that its transform keeps single precision.
        spectra = cast(_Spectra, fft.rfft2(rotated))
        if self.whitening > 0.0:
            magnitude = np.abs(spectra) + np.float32(_MIN_MAGNITUDE)
            # A square root is several times faster than a power.
            if self.whitening == 0.5:
                np.sqrt(magnitude, out=magnitude)
            else:
                np.power(magnitude, self.whitening, out=magnitude)
            # NumPy would convert a real divisor of complex numbers to a complex one.
            spectra.real /= magnitude
            spectra.imag /= magnitude
        return spectra

    def _peaks(self, correlation: _Grids) -> Iterator[tuple[int, int, int, float]]:
        """Yield heading, i, j and relative score of the peaks, highest first.

        Suppresses the neighbourhood of each peak in `correlation`.
        """
        best = 0.0
        for _ in range(self.max_hypotheses):
            heading, i, j = (
                int(k) for k in np.unravel_index(int(correlation.argmax()), correlation.shape)
            )
            value = float(correlation[heading, i, j])
            best = max(best, value)
            if value <= self.min_score_ratio * best:
                return
            yield heading, i, j, value / best
            _suppress(correlation, heading, i, j)

    def _level_pose(self, heading: int, i: int, j: int, cell_size: float) -> Pose:
        """Return the pose between the levelled frames at an entry of the correlation."""
        quadrant = heading // (self.headings // 4)
        x, y = _rotated_by_right_angles(_unwrapped(i), _unwrapped(j), quadrant)
        yaw = 2.0 * math.pi * heading / self.headings
        return Pose(exp_rotation(np.array([0.0, 0.0, yaw])), cell_size * np.array([x, y, 0.0]))


def _cell_size(radius: float) -> float:
    return next((size for size in _CELL_SIZES if radius <= size * _RADIUS_CELLS), _CELL_SIZES[-1])


def _cells_within(grid: BevGrid, radius: float) -> tuple[Matrix, Vector, Matrix]:
    """Return occupied cells, occupancy and free cells within a horizontal range [m]."""
    is_occupied_near = np.hypot(*grid.occupied_cells.T) < radius
    is_free_near = np.hypot(*grid.free_cells.T) < radius
    return (
        read_only(grid.occupied_cells[is_occupied_near]),
        read_only(grid.occupancy[is_occupied_near]),
        read_only(grid.free_cells[is_free_near]),
    )


def _unwrapped(index: int) -> int:
    """Return the signed translation of an index of the correlation [cells]."""
    return (index + _GRID_SIZE // 2) % _GRID_SIZE - _GRID_SIZE // 2


def _rotated_by_right_angles(i: int, j: int, count: int) -> tuple[int, int]:
    for _ in range(count % 4):
        i, j = -j, i
    return i, j


def _suppress(correlation: _Grids, heading: int, i: int, j: int) -> None:
    """Set a peak and its neighbours in heading and translation to minus infinity."""
    headings = len(correlation)
    offsets = np.arange(-_SUPPRESSION_RADIUS, _SUPPRESSION_RADIUS + 1)
    for near in (heading + offsets) % headings:
        # Adjacent headings of another quadrant refer to a target rotated differently.
        quadrants = heading * 4 // headings - int(near) * 4 // headings
        x, y = _rotated_by_right_angles(i, j, quadrants)
        correlation[near, (x + offsets[:, None]) % _GRID_SIZE, (y + offsets) % _GRID_SIZE] = -np.inf
