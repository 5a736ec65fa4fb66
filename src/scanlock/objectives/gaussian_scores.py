"""The scores of NDT over all Gaussians: rho and Lambda of Das et al. 2013, sections VI, VII."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from scanlock.arrays import Labels, Points, Vector
from scanlock.errors import InvalidInput, require_positive
from scanlock.geometry.pose import Pose
from scanlock.kernels.terms import d2d_terms, p2d_terms
from scanlock.kernels.tiles import tile_lists
from scanlock.models.gaussians import Gaussians
from scanlock.objectives.quadratic import Curvature, Quadratic

_TILE_WIDTH = 3.0
"""Side of the tiles that list the Gaussians in reach [m]; about the size of a cluster."""

_MOST_TILES_A_SIDE = 256
"""Wide maps get wider tiles instead of more memory."""


@dataclass(frozen=True, kw_only=True, slots=True)
class ScoreShape:
    """The score of one pair as a function of its squared Mahalanobis distance s.

    ``-exp(-sharpness s / 2)``, cut off by a window that is 1 up to `window_start` and falls to
    0 at `window_end` with two continuous derivatives, so that skipping pairs beyond the end
    changes nothing that a solver can see.
    """

    sharpness: float = 1.0
    """1 in the paper; smaller values widen the basin (0.05 in Stoyanov's published code)."""

    window_start: float = 16.0
    """Squared distance, times the sharpness, where the window begins to fall; what is cut
    weighs under e^-8."""

    window_end: float = 25.0
    """Squared distance, times the sharpness, from which a pair counts nothing."""

    def __post_init__(self) -> None:
        require_positive("sharpness", self.sharpness)
        require_positive("window_start", self.window_start)
        if not self.window_end > self.window_start:
            raise InvalidInput(
                f"window_end must be above window_start = {self.window_start}, "
                f"got {self.window_end}"
            )

    @property
    def parameters(self) -> tuple[float, float, float]:
        """Sharpness, and the squared distances where the window begins and ends."""
        return (
            self.sharpness,
            self.window_start / self.sharpness,
            self.window_end / self.sharpness,
        )


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class GaussiansToGaussians:
    """D2D: every Gaussian of the source against every Gaussian of the target.

    The value is minus the sum over all pairs of ``w_i w_j rho``, with the counts to
    `weight_power`, scaled to unit length, as the weights of either side; it is symmetric under
    exchange of the scans.
    """

    target: Gaussians
    source: Gaussians
    shape: ScoreShape = field(default_factory=ScoreShape)
    weight_power: float = 0.5
    curvature: Curvature = "exact"

    @property
    def count(self) -> int:
        """The Gaussians of the source."""
        return len(self.source)

    def linearise(self, pose: Pose) -> Quadratic:
        """Return value, gradient and Hessian at `pose`."""
        return Quadratic.from_terms(
            d2d_terms(
                self.target.means,
                self.target.packed_covariances,
                self.target.widths,
                self.target.weights(self.weight_power),
                self.source.means,
                self.source.packed_covariances,
                self.source.widths,
                self.source.weights(self.weight_power),
                pose.rotation,
                pose.translation,
                *self.shape.parameters,
                float(self.curvature == "exact"),
            )
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class PointsToGaussians:
    """P2D: every point of the source against every Gaussian of the target.

    The value is minus the mean over the points of the sum over the Gaussians of ``rho``, the
    cost Lambda of the paper divided by the number of points.
    """

    target: Gaussians
    points: Points
    shape: ScoreShape = field(default_factory=ScoreShape)
    curvature: Curvature = "exact"

    @property
    def count(self) -> int:
        """The points of the source."""
        return len(self.points)

    def linearise(self, pose: Pose) -> Quadratic:
        """Return value, gradient and Hessian at `pose`."""
        terms = p2d_terms(
            self.points,
            self.target.means,
            self.target.packed_precisions,
            *self._tiles,
            pose.rotation,
            pose.translation,
            *self.shape.parameters,
            float(self.curvature == "exact"),
        )
        return Quadratic.from_terms(terms / len(self.points))

    @cached_property
    def _tiles(self) -> tuple[Labels, Labels, Vector, float, int, int]:
        """Lists of the Gaussians that can meet a point of each tile of the plane."""
        _, _, window_end = self.shape.parameters
        radii = np.sqrt(window_end * self.target.widths)
        low = (self.target.means[:, :2] - radii[:, None]).min(axis=0)
        high = (self.target.means[:, :2] + radii[:, None]).max(axis=0)
        width = max(_TILE_WIDTH, float((high - low).max()) / _MOST_TILES_A_SIDE)
        columns, rows = (int(count) for count in np.floor((high - low) / width) + 1)
        starts, members = tile_lists(self.target.means, radii, low, width, columns, rows)
        return starts, members, low, width, columns, rows
