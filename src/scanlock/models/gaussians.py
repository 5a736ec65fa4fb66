"""Parts of a scan as Gaussians: means, covariances, counts."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scanlock.arrays import Counts, Labels, Mask, Matrix, Points, Vector, frozen, read_only
from scanlock.clouds.voxel_grid import voxel_labels
from scanlock.errors import InvalidInput, require_at_least, require_positive
from scanlock.geometry.pose import Pose
from scanlock.kernels.gaussians.eigen3 import floored_covariances
from scanlock.kernels.gaussians.packed import merged_moments, packed_inverses, packed_turned
from scanlock.kernels.points.moments import labelled_moments

_PACKED_ROWS = (0, 0, 0, 1, 1, 2)
_PACKED_COLUMNS = (0, 1, 2, 1, 2, 2)
_PACKED_IDENTITY = np.array([1.0, 0.0, 0.0, 1.0, 0.0, 1.0])


@dataclass(frozen=True, eq=False)
class Gaussians:
    """A set of k Gaussians in one frame.

    Attributes
    ----------
    means : (k, 3) [m]
    packed_covariances : (k, 6) [m^2]
        The upper triangles xx, xy, xz, yy, yz, zz. `from_labels` divides by the count, as in Das
        et al. 2013, section VI; those of voxels, from `models.voxel_gaussians`, are divided by
        the count less one.
    counts : (k,)
        Points behind each Gaussian; of merged ones, what gives them their weight.
    """

    means: Points
    packed_covariances: Matrix
    counts: Counts

    def __post_init__(self) -> None:
        k = len(self.means)
        if self.means.shape != (k, 3) or self.packed_covariances.shape != (k, 6):
            raise InvalidInput(
                "means and packed covariances must have shapes (k, 3) and (k, 6), got "
                f"{self.means.shape} and {self.packed_covariances.shape}"
            )
        if self.counts.shape != (k,):
            raise InvalidInput(f"counts must have shape ({k},), got {self.counts.shape}")
        for name in ("means", "packed_covariances", "counts"):
            # A part of a wider table is not contiguous, and kernels are made for what is.
            array = np.ascontiguousarray(getattr(self, name))
            frozen(array)
            object.__setattr__(self, name, array)

    @classmethod
    def from_covariances(
        cls, means: Points, covariances: NDArray[np.float64], counts: Counts
    ) -> "Gaussians":
        """Return the Gaussians of means (k, 3) [m] and symmetric covariances (k, 3, 3) [m^2]."""
        if covariances.shape[1:] != (3, 3):
            raise InvalidInput(f"covariances must have shape (k, 3, 3), got {covariances.shape}")
        packed = np.ascontiguousarray(covariances[:, _PACKED_ROWS, _PACKED_COLUMNS])
        return cls(means, packed, counts)

    @classmethod
    def from_labels(cls, points: Points, labels: Labels, least_count: int = 1) -> "Gaussians":
        """Return the Gaussian of each part with at least `least_count` points, by label.

        Parameters
        ----------
        points : (n, 3) [m]
        labels : (n,)
            Part of each point; -1 leaves it out.
        least_count : int
            Parts of fewer points are skipped: their covariance says little.
        """
        require_at_least("least_count", least_count, 1)
        parts = int(labels.max(initial=-1)) + 1
        counts, means, packed = labelled_moments(read_only(points), read_only(labels), parts)
        kept = counts >= least_count
        return cls(means[kept], packed[kept], counts[kept])

    @classmethod
    def joined(cls, parts: "Sequence[Gaussians]") -> "Gaussians":
        """Return the Gaussians of several sets as one, in the order given."""
        joined = cls(
            np.concatenate([part.means for part in parts]),
            np.concatenate([part.packed_covariances for part in parts]),
            np.concatenate([part.counts for part in parts]),
        )
        return joined._reshaped(
            joined.packed_covariances, np.concatenate([part.variances for part in parts])
        )

    def __len__(self) -> int:
        return len(self.means)

    @cached_property
    def covariances(self) -> NDArray[np.float64]:
        """The (k, 3, 3) covariances [m^2]."""
        covariances = unpacked(self.packed_covariances)
        frozen(covariances)
        return covariances

    @cached_property
    def packed_precisions(self) -> Matrix:
        """The (k, 6) upper triangles of the inverse covariances."""
        precisions = packed_inverses(read_only(self.packed_covariances))
        frozen(precisions)
        return precisions

    @cached_property
    def variances(self) -> Matrix:
        """The (k, 3) variances [m^2] along the principal axes, ascending."""
        _, variances = floored_covariances(read_only(self.packed_covariances), 0.0, 0.0)
        frozen(variances)
        return variances

    @cached_property
    def widths(self) -> Vector:
        """The (k,) largest variances [m^2]; no rotation changes them."""
        widths = np.ascontiguousarray(self.variances[:, 2], dtype=np.float64)
        frozen(widths)
        return widths

    def weights(self, power: float = 0.5) -> Vector:
        """Return the (k,) counts to a power, scaled to unit length.

        Equal weights (power 0) trust a distant handful of points as much as a facade; the
        counts themselves (power 1) would let the nearest object decide alone.
        """
        weights = self.counts.astype(np.float64) ** power
        norm = np.linalg.norm(weights)
        weights = weights / norm if norm > 0 else weights
        frozen(weights)
        return weights

    def taken(self, rows: Labels | Mask) -> "Gaussians":
        """Return the Gaussians at the given rows, in that order."""
        return Gaussians(self.means[rows], self.packed_covariances[rows], self.counts[rows])

    def regularised(self, deviation: float, ratio: float = 0.0) -> "Gaussians":
        """Return the same Gaussians with no principal deviation too small to invert.

        Parameters
        ----------
        deviation : float [m]
            Least standard deviation along any principal axis: the sensor's noise and more.
        ratio : float
            Least share of the largest variance of the same Gaussian (0.01 in Magnusson 2009).
        """
        require_positive("deviation", deviation, unit="m")
        require_at_least("ratio", ratio, 0.0)
        packed, variances = floored_covariances(
            read_only(self.packed_covariances), float(deviation) ** 2, float(ratio)
        )
        return self._reshaped(packed, variances)

    def scaled(self, factor: float) -> "Gaussians":
        """Return the same Gaussians with every standard deviation `factor` times as large."""
        require_positive("factor", factor)
        return self._reshaped(self.packed_covariances * factor**2, self.variances * factor**2)

    def inflated(self, deviation: float) -> "Gaussians":
        """Return the Gaussians blurred by an isotropic one of standard deviation [m]."""
        require_at_least("deviation", deviation, 0.0, unit="m")
        return self._reshaped(
            self.packed_covariances + deviation**2 * _PACKED_IDENTITY,
            self.variances + deviation**2,
        )

    def merged(self, width: float, weight_power: float) -> "Gaussians":
        """Return one Gaussian for all that have their means in one cube of a side [m].

        It has the mean and covariance of the mixture of those, weighted by their counts to
        `weight_power`, and such a count that its own weight is the sum of theirs.
        """
        require_positive("width", width, unit="m")
        require_positive("weight_power", weight_power)
        if len(self) == 0:
            return self
        labels, parts = voxel_labels(self.means, width)
        means, packed, weights = merged_moments(
            read_only(self.means),
            read_only(self.packed_covariances),
            read_only(self.counts.astype(np.float64) ** weight_power),
            read_only(labels),
            parts,
        )
        return Gaussians(means, packed, weights ** (1.0 / weight_power))

    def transformed(self, pose: Pose) -> "Gaussians":
        """Return the Gaussians moved by a pose; covariances turn with it."""
        turned = packed_turned(read_only(self.packed_covariances), pose.rotation)
        moved = Gaussians(pose.apply(self.means), turned, self.counts)
        return moved._reshaped(turned, self.variances)

    def _reshaped(self, packed: Matrix, variances: Matrix) -> "Gaussians":
        reshaped = Gaussians(self.means, packed, self.counts)
        frozen(variances)
        # The principal variances are known here, and decomposing anew costs more than a score.
        reshaped.__dict__["variances"] = variances
        return reshaped

    def __reduce__(self) -> tuple[Any, ...]:
        return Gaussians, (
            np.array(self.means),
            np.array(self.packed_covariances),
            np.array(self.counts),
        )


def unpacked(packed: Matrix) -> NDArray[np.float64]:
    """Return (k, 3, 3) symmetric matrices of (k, 6) upper triangles."""
    full = np.empty((len(packed), 3, 3))
    full[:, _PACKED_ROWS, _PACKED_COLUMNS] = packed
    full[:, _PACKED_COLUMNS, _PACKED_ROWS] = packed
    return full
