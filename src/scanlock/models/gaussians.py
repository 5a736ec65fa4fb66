"""Sets of 3D Gaussians: means, covariances and point counts."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scanlock.arrays import (
    Counts,
    Labels,
    Mask,
    Matrix,
    Points,
    Vector,
    frozen,
    read_only,
    short_repr,
)
from scanlock.clouds.voxel_grid import voxel_labels
from scanlock.errors import InvalidInput, require_at_least, require_positive
from scanlock.geometry.pose import Pose
from scanlock.kernels.gaussians.eigen3 import regularised_covariances
from scanlock.kernels.gaussians.packed import merged_moments, packed_inverses, packed_rotated
from scanlock.kernels.points.moments import labelled_moments

_PACKED_ROWS = (0, 0, 0, 1, 1, 2)
_PACKED_COLUMNS = (0, 1, 2, 1, 2, 2)
_PACKED_IDENTITY = np.array([1.0, 0.0, 0.0, 1.0, 0.0, 1.0])


@dataclass(frozen=True, eq=False)
class Gaussians:
    """Set of k Gaussians in a common frame.

    Attributes
    ----------
    means : (k, 3) [m]
        Mean of each Gaussian.
    packed_covariances : (k, 6) [m^2]
        Upper triangles of the covariances: xx, xy, xz, yy, yz, zz. `from_labels` divides by the
        count n (Das et al. 2013, section VI), `scanlock.models.voxel_gaussians` by n - 1.
    counts : (k,)
        Number of points of each Gaussian; `merged` Gaussians may have a fractional count.

    Raises
    ------
    InvalidInput
        Shapes that do not match.
    """

    means: Points
    packed_covariances: Matrix
    counts: Counts

    __repr__ = short_repr

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
            # Kernels are compiled for contiguous arrays; a slice of a wider table is not one.
            array = np.ascontiguousarray(getattr(self, name))
            frozen(array)
            object.__setattr__(self, name, array)

    @classmethod
    def from_covariances(
        cls, means: Points, covariances: NDArray[np.float64], counts: Counts
    ) -> "Gaussians":
        """Return the Gaussians of (k, 3) means [m] and symmetric (k, 3, 3) covariances [m^2]."""
        if covariances.shape[1:] != (3, 3):
            raise InvalidInput(f"covariances must have shape (k, 3, 3), got {covariances.shape}")
        packed = np.ascontiguousarray(covariances[:, _PACKED_ROWS, _PACKED_COLUMNS])
        return cls(means, packed, counts)

    @classmethod
    def from_labels(cls, points: Points, labels: Labels, min_points: int = 1) -> "Gaussians":
        """Fit a Gaussian to each cluster of points, in the order of the labels.

        Parameters
        ----------
        points : (n, 3) [m]
            Points.
        labels : (n,)
            Cluster of each point; -1 for none.
        min_points : int
            Minimum number of points; clusters of fewer points are skipped.

        Raises
        ------
        InvalidInput
            `min_points` is less than 1.
        """
        require_at_least("min_points", min_points, 1)
        clusters = int(labels.max(initial=-1)) + 1
        counts, means, packed = labelled_moments(read_only(points), read_only(labels), clusters)
        is_large = counts >= min_points
        return cls(means[is_large], packed[is_large], counts[is_large])

    @classmethod
    def joined(cls, sets: "Sequence[Gaussians]") -> "Gaussians":
        """Concatenate several sets of Gaussians."""
        joined = cls(
            np.concatenate([one.means for one in sets]),
            np.concatenate([one.packed_covariances for one in sets]),
            np.concatenate([one.counts for one in sets]),
        )
        return joined._with_covariances(
            joined.packed_covariances, np.concatenate([one.variances for one in sets])
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
        """The (k, 6) upper triangles of the inverse covariances [1/m^2]."""
        precisions = packed_inverses(read_only(self.packed_covariances))
        frozen(precisions)
        return precisions

    @cached_property
    def variances(self) -> Matrix:
        """The (k, 3) variances [m^2] along the principal axes, ascending."""
        _, variances = regularised_covariances(read_only(self.packed_covariances), 0.0, 0.0)
        frozen(variances)
        return variances

    @cached_property
    def max_variances(self) -> Vector:
        """The (k,) largest principal variances [m^2]; they are invariant to rotation."""
        largest = np.ascontiguousarray(self.variances[:, 2], dtype=np.float64)
        frozen(largest)
        return largest

    def weights(self, power: float = 0.5) -> Vector:
        """Return the (k,) counts to a power, scaled to unit norm.

        Equal weights (power 0) give few distant points the weight of a facade. With the counts
        as weights (power 1) the nearest object dominates.
        """
        weights = self.counts.astype(np.float64) ** power
        norm = np.linalg.norm(weights)
        weights = weights / norm if norm > 0 else weights
        frozen(weights)
        return weights

    def taken(self, rows: Labels | Mask) -> "Gaussians":
        """Return the Gaussians at the given rows, in that order, or of a mask."""
        return Gaussians(self.means[rows], self.packed_covariances[rows], self.counts[rows])

    def with_most_points(self, count: int) -> "Gaussians":
        """Return the `count` Gaussians of the most points, in their order; all if there are fewer.

        Of equally many points, the first ones are taken.
        """
        if len(self) <= count:
            return self
        order = np.argsort(-self.counts, kind="stable")[:count]
        return self.taken(np.sort(order))

    def regularised(self, deviation: float, ratio: float = 0.0) -> "Gaussians":
        """Return the Gaussians with their principal variances raised to a minimum.

        Parameters
        ----------
        deviation : float [m]
            Minimum standard deviation along any principal axis; at least the sensor noise.
        ratio : float
            Minimum variance relative to the largest of the same Gaussian (0.01 in Magnusson
            2009).

        Raises
        ------
        InvalidInput
            A deviation that is not positive, or a negative ratio.
        """
        require_positive("deviation", deviation, unit="m")
        require_at_least("ratio", ratio, 0.0)
        packed, variances = regularised_covariances(
            read_only(self.packed_covariances), float(deviation) ** 2, float(ratio)
        )
        return self._with_covariances(packed, variances)

    def scaled(self, factor: float) -> "Gaussians":
        """Return the Gaussians with every standard deviation multiplied by `factor`."""
        require_positive("factor", factor)
        return self._with_covariances(
            self.packed_covariances * factor**2, self.variances * factor**2
        )

    def inflated(self, deviation: float) -> "Gaussians":
        """Return the Gaussians convolved with an isotropic one of standard deviation [m]."""
        require_at_least("deviation", deviation, 0.0, unit="m")
        return self._with_covariances(
            self.packed_covariances + deviation**2 * _PACKED_IDENTITY,
            self.variances + deviation**2,
        )

    def merged(self, voxel_size: float, weight_power: float) -> "Gaussians":
        """Merge the Gaussians whose means are in the same voxel.

        Parameters
        ----------
        voxel_size : float [m]
            Side of the voxels.
        weight_power : float
            Power of the counts that gives the weights; see `weights`.

        Returns
        -------
        Gaussians
            For each voxel the mean and covariance of the weighted mixture. Its count is chosen so
            that its weight is the sum of the weights.

        Raises
        ------
        InvalidInput
            A voxel size or power that is not positive.
        """
        require_positive("voxel_size", voxel_size, unit="m")
        require_positive("weight_power", weight_power)
        if len(self) == 0:
            return self
        labels, voxels = voxel_labels(self.means, voxel_size)
        means, packed, weights = merged_moments(
            read_only(self.means),
            read_only(self.packed_covariances),
            read_only(self.counts.astype(np.float64) ** weight_power),
            read_only(labels),
            voxels,
        )
        return Gaussians(means, packed, weights ** (1.0 / weight_power))

    def transformed(self, pose: Pose) -> "Gaussians":
        """Return the Gaussians transformed by a pose."""
        rotated = packed_rotated(read_only(self.packed_covariances), pose.rotation)
        moved = Gaussians(pose.apply(self.means), rotated, self.counts)
        return moved._with_covariances(rotated, self.variances)

    def _with_covariances(self, packed: Matrix, variances: Matrix) -> "Gaussians":
        changed = Gaussians(self.means, packed, self.counts)
        frozen(variances)
        # The principal variances are known; another decomposition costs more than a score.
        changed.__dict__["variances"] = variances
        return changed

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
