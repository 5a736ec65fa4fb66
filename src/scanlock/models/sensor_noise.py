"""Covariances of points from the noise of a lidar in range and angle.

A point at range r, azimuth a and elevation e has, to first order, the covariance
``J diag(s_r^2, s_a^2, s_e^2) J'`` with the Jacobian J of
``(r cos e cos a, r cos e sin a, r sin e)``. Madhavan and Messina 2003 leave this uncertainty to
later work.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scanlock.arrays import Matrix, Points
from scanlock.errors import require_at_least, require_positive

_PACKED_ROWS = [0, 0, 0, 1, 1, 2]
_PACKED_COLUMNS = [0, 1, 2, 1, 2, 2]


@dataclass(frozen=True, kw_only=True, slots=True)
class SensorNoise:
    """Standard deviations of a lidar return in polar coordinates."""

    range_deviation: float = 0.02
    """Standard deviation of the range [m]."""

    azimuth_deviation: float = 6e-4
    """Standard deviation of the azimuth [rad]; the default is that of a beam of 2 mrad."""

    elevation_deviation: float = 6e-4
    """Standard deviation of the elevation [rad]."""

    def __post_init__(self) -> None:
        require_positive("range_deviation", self.range_deviation, unit="m")
        require_at_least("azimuth_deviation", self.azimuth_deviation, 0.0, unit="rad")
        require_at_least("elevation_deviation", self.elevation_deviation, 0.0, unit="rad")

    def covariances(self, points: Points) -> Matrix:
        """Return the (n, 6) covariances of points [m^2], packed as xx, xy, xz, yy, yz, zz.

        Parameters
        ----------
        points : (n, 3) [m]
            Points in the sensor frame. A point at the origin has no direction; its covariance is
            isotropic, with the deviation of the range.

        Notes
        -----
        The minimum variance is 1e-6 of that of the range, so that every covariance is invertible,
        above the sensor and without angular noise too.
        """
        deviations = np.array(
            [self.range_deviation, self.azimuth_deviation, self.elevation_deviation]
        )
        factors = polar_jacobian(points) * deviations
        full = np.einsum("nij,nkj->nik", factors, factors)
        full += 1e-6 * self.range_deviation**2 * np.eye(3)
        at_origin = ~points.any(axis=1)
        full[at_origin] = self.range_deviation**2 * np.eye(3)
        return np.ascontiguousarray(full[:, _PACKED_ROWS, _PACKED_COLUMNS])


def polar_jacobian(points: Points) -> NDArray[np.float64]:
    """Return the (n, 3, 3) Jacobians of x, y, z with respect to range, azimuth and elevation.

    Column j of each matrix is the derivative by polar coordinate j. The azimuth of points on the
    z axis is undefined and taken as zero.
    """
    x, y, z = points.T
    horizontal, distance = np.hypot(x, y), np.linalg.norm(points, axis=1)
    cos_azimuth = np.divide(x, horizontal, out=np.ones_like(x), where=horizontal > 0.0)
    sin_azimuth = np.divide(y, horizontal, out=np.zeros_like(y), where=horizontal > 0.0)
    by_range = np.divide(
        points, distance[:, None], out=np.zeros_like(points), where=distance[:, None] > 0.0
    )
    by_azimuth = np.stack([-y, x, np.zeros_like(x)], axis=1)
    by_elevation = np.stack([-z * cos_azimuth, -z * sin_azimuth, horizontal], axis=1)
    return np.stack([by_range, by_azimuth, by_elevation], axis=2)


def traces(covariances: Matrix) -> NDArray[np.float64]:
    """Return the (n,) traces of packed covariances [m^2]; they are invariant to rotation."""
    return covariances[:, 0] + covariances[:, 3] + covariances[:, 5]
