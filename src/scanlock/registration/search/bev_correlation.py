"""Headings and places at which two scans agree when seen from above: one search over them all.

With the ground of both scans level, what is left of a pose are a heading and a shift in the
plane. For every heading, one correlation by Fourier transform tells the agreement at every shift,
so no starting pose is needed and none can be missed for want of a match between features.
"""

import math
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
from scanlock.kernels.search.rotated_grids import turned_maps
from scanlock.registration.search.bev_grid import BevGrid, BevGridder
from scanlock.registration.search.ground_alignment import ground_fitted
from scanlock.registration.search.hypothesis import Hypothesis
from scanlock.segmentation.ground.finder import Ground
from scanlock.threads import parallel_map

_Maps = NDArray[np.float32]
_Spectra = NDArray[np.complex64]

_CELLS = 30
"""Cells of the map from its axis to the end of a scan."""

_SIDE = 96
"""Cells along a side: two scans of 30 cells' reach and shifts of up to 36 cells do not wrap."""

_WIDTHS = (0.5, 1.0, 2.0)
"""Sides of a cell [m]: the least one whose map holds both scans, or the last."""

_LEAST_MAGNITUDE = 1e-6
"""Keeps frequencies that neither scan has from a division by zero."""

_APART = 2
"""Peaks this many cells or headings apart along any axis are two places."""


@dataclass(frozen=True, kw_only=True, slots=True)
class BevSearch:
    """Settings of the search; `view` each scan once, then `hypotheses` for any pair."""

    gridder: BevGridder = field(default_factory=BevGridder)
    """What is seen of a scan from above."""

    headings: int = 92
    """How many, evenly around the circle, a multiple of four; 4 degrees are a cell at the end of
    the map."""

    free_cell_weight: float = 0.2
    """What open ground counts against a full column; agrees with itself, and with none of them."""

    whitening: float = 0.5
    """Power of a frequency's magnitude that is divided out of the correlation: 0 leaves it, 1
    keeps the phase alone. Slopes and thickets are large and alike; posts and corners are not."""

    align_ground: bool = True
    """Whether height, roll and pitch follow the ground that both scans saw."""

    max_hypotheses: int = 8
    """How many hypotheses, at most."""

    min_score_ratio: float = 0.5
    """A peak below this share of the highest is no hypothesis."""

    def __post_init__(self) -> None:
        require_count("headings", self.headings, 4)
        if self.headings % 4:
            raise InvalidInput(f"headings must be a multiple of four, got {self.headings}")
        require_at_least("free_cell_weight", self.free_cell_weight, 0.0)
        require_fraction("whitening", self.whitening)
        require_count("max_hypotheses", self.max_hypotheses, 1)
        require_fraction("min_score_ratio", self.min_score_ratio)

    def grid(self, cloud: PointCloud, ground: Ground) -> BevGrid:
        """Return what the search needs of a scan."""
        return self.gridder.view(cloud, ground)

    def hypotheses(self, target: BevGrid, source: BevGrid) -> list[Hypothesis]:
        """Return the places of best agreement, best first; none where a scan shows nothing.

        The weight of the first is 1, that of the others their share of its agreement.
        """
        if len(target.columns) == 0 or len(source.columns) == 0:
            return []
        cell = _cell_for(max(target.reach, source.reach))
        agreement = self._agreement(target, source, cell)
        found: list[Hypothesis] = []
        best = 0.0
        for _ in range(self.max_hypotheses):
            heading, i, j = (
                int(k) for k in np.unravel_index(int(agreement.argmax()), agreement.shape)
            )
            height = float(agreement[heading, i, j])
            best = max(best, height)
            if height <= self.min_score_ratio * best:
                break
            quarter = heading // (self.headings // 4)
            x, y = _quarter_turned(_signed(i), _signed(j), quarter)
            turn = 2.0 * math.pi * heading / self.headings
            level = Pose(exp_rotation(np.array([0.0, 0.0, turn])), cell * np.array([x, y, 0.0]))
            pose = target.level_from_scan.inverse() @ level @ source.level_from_scan
            if self.align_ground:
                pose = ground_fitted(target, source, pose)
            found.append(Hypothesis(pose, height / best, "heading search"))
            _clear_around(agreement, heading, i, j)
        return found

    def _agreement(self, target: BevGrid, source: BevGrid, cell: float) -> _Maps:
        """Return the (h, side, side) correlation at each heading and shift; shifts wrap.

        Maps of cells can be turned by a right angle without loss, so the headings of one quarter
        of the circle against four turns of the target stand for all: shifts of the quarter q are
        those of a target turned back by q right angles.
        """
        quarters = np.linspace(0.0, -2.0 * math.pi, 4, endpoint=False)
        turns = np.linspace(0.0, 0.5 * math.pi, self.headings // 4, endpoint=False)
        stays, moves = parallel_map(
            lambda side: self._spectra(*side, cell), ((target, quarters), (source, turns))
        )
        moves = moves.conj()
        agreement = np.empty((4, len(turns), _SIDE, _SIDE), np.float32)

        def correlate(quarter: int) -> None:
            product = stays[quarter] * moves
            agreement[quarter] = cast(
                _Maps, fft.irfft2(product, s=(_SIDE, _SIDE), overwrite_x=True)
            )

        # A quarter at a time, which a cache holds.
        parallel_map(correlate, range(4))
        return agreement.reshape(self.headings, _SIDE, _SIDE)

    def _spectra(self, view: BevGrid, turns: Vector, cell: float) -> _Spectra:
        """Return the transforms of the maps at each turn, whitened."""
        # SciPy's transform keeps single precision; its stubs do not know what it returns.
        spectra = cast(_Spectra, fft.rfft2(self._maps(view, turns, cell)))
        if self.whitening > 0.0:
            magnitude = np.abs(spectra) + np.float32(_LEAST_MAGNITUDE)
            # The root alone is several times faster than a power.
            if self.whitening == 0.5:
                np.sqrt(magnitude, out=magnitude)
            else:
                np.power(magnitude, self.whitening, out=magnitude)
            # Either part by itself: NumPy would divide by complex numbers.
            spectra.real /= magnitude
            spectra.imag /= magnitude
        return spectra

    def _maps(self, view: BevGrid, turns: Vector, cell: float) -> _Maps:
        return turned_maps(
            *_within(view, cell * _CELLS), self.free_cell_weight, read_only(turns), cell, _SIDE
        )


def _within(view: BevGrid, reach: float) -> tuple[Matrix, Vector, Matrix]:
    """Return the columns, their fills and the open columns within a range [m]."""
    near = np.hypot(*view.columns.T) < reach
    open_near = np.hypot(*view.open_columns.T) < reach
    return (
        read_only(view.columns[near]),
        read_only(view.fills[near]),
        read_only(view.open_columns[open_near]),
    )


def _cell_for(reach: float) -> float:
    return next((width for width in _WIDTHS if reach <= width * _CELLS), _WIDTHS[-1])


def _signed(index: int) -> int:
    return (index + _SIDE // 2) % _SIDE - _SIDE // 2


def _quarter_turned(i: int, j: int, quarters: int) -> tuple[int, int]:
    """Return a shift turned by so many right angles."""
    for _ in range(quarters % 4):
        i, j = -j, i
    return i, j


def _clear_around(agreement: _Maps, heading: int, i: int, j: int) -> None:
    """Put a peak and what belongs to it out of the running."""
    headings = len(agreement)
    around = np.arange(-_APART, _APART + 1)
    for near in (heading + around) % headings:
        # The headings beside it may count shifts from a target turned otherwise.
        quarters = heading * 4 // headings - int(near) * 4 // headings
        x, y = _quarter_turned(i, j, quarters)
        agreement[near, (x + around[:, None]) % _SIDE, (y + around) % _SIDE] = -np.inf
