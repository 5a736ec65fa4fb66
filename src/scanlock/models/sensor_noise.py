"""What a sensor's noise in range and angle means for the place of each point.

Madhavan and Messina 2003 leave the uncertainty of the scans to later work. A point at range r,
azimuth a and elevation e has, to first order, the covariance ``J diag(s_r^2, s_a^2, s_e^2) J'``
with the Jacobian J of ``(r cos e cos a, r cos e sin a, r sin e)``.
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
    """Standard deviations of one return, the same for all."""

    range_deviation: float = 0.02
    """Along the beam [m]."""

    azimuth_deviation: float = 6e-4
    """About the vertical axis [rad]: a beam 2 mrad wide, whose return may be from any of it."""

    elevation_deviation: float = 6e-4
    """Up and down [rad]."""

    def __post_init__(self) -> None:
        require_positive("range_deviation", self.range_deviation, unit="m")
        require_at_least("azimuth_deviation", self.azimuth_deviation, 0.0, unit="rad")
        require_at_least("elevation_deviation", self.elevation_deviation, 0.0, unit="rad")

    def covariances(self, points: Points) -> Matrix:
        """Return the (n, 6) covariances [m^2], packed as xx, xy, xz, yy, yz, zz.

        Parameters
        ----------
        points : (n, 3) [m]
            In the frame of the sensor: range and angles are about zero. A point at zero itself
            has no direction, and is given the deviation of the range along all axes.

        Notes
        -----
        No variance is below the millionth part of that of the range, so that straight above the
        sensor, or without angular noise, a covariance can still be inverted.
        """
        deviations = np.array(
            [self.range_deviation, self.azimuth_deviation, self.elevation_deviation]
        )
        spread = polar_jacobian(points) * deviations
        full = np.einsum("nij,nkj->nik", spread, spread)
        full += 1e-6 * self.range_deviation**2 * np.eye(3)
        at_zero = ~points.any(axis=1)
        full[at_zero] = self.range_deviation**2 * np.eye(3)
        return np.ascontiguousarray(full[:, _PACKED_ROWS, _PACKED_COLUMNS])


def polar_jacobian(points: Points) -> NDArray[np.float64]:
    """Return (n, 3, 3) the derivatives of x, y, z in range, azimuth and elevation.

    Column j of each matrix belongs to coordinate j. Where the azimuth of a point is open it is
    taken as zero.
    """
    x, y, z = points.T
    flat, distance = np.hypot(x, y), np.linalg.norm(points, axis=1)
    cos_azimuth = np.divide(x, flat, out=np.ones_like(x), where=flat > 0.0)
    sin_azimuth = np.divide(y, flat, out=np.zeros_like(y), where=flat > 0.0)
    along = np.divide(
        points, distance[:, None], out=np.zeros_like(points), where=distance[:, None] > 0.0
    )
    around = np.stack([-y, x, np.zeros_like(x)], axis=1)
    upward = np.stack([-z * cos_azimuth, -z * sin_azimuth, flat], axis=1)
    return np.stack([along, around, upward], axis=2)


def traces(covariances: Matrix) -> NDArray[np.float64]:
    """Return the (n,) traces of packed covariances: total variances, whatever the rotation."""
    return covariances[:, 0] + covariances[:, 3] + covariances[:, 5]
