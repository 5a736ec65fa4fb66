"""The pan/tilt platform that a sensor looks around on, and where it is fixed to its vehicle."""

import math
from dataclasses import dataclass

import numpy as np

from scanlock.errors import InvalidInput, require_at_least, require_positive
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import exp_rotation

_ROUNDING = 1e-9
"""How far past its stop [rad] an angle may be by rounding, as of degrees turned to radians."""


@dataclass(frozen=True, kw_only=True, slots=True)
class PanTiltMount:
    """A platform that pans about the vehicle's z axis and tilts about the panned y axis.

    Readings of the two encoders become a pose through lever arms and calibration. The paper
    names a mount position and calibration factors and gives a tilt of +-30 degrees; every other
    number here is ours.
    """

    lever_arm: tuple[float, float, float] = (0.8, 0.0, 0.25)
    """Where the pan and the tilt axis cross, in the frame of the vehicle [m]."""
    head_offset: tuple[float, float, float] = (0.12, 0.0, 0.1)
    """From there to the sensor's origin, along the axes of the panned and tilted head [m]."""
    misalignment: tuple[float, float, float] = (0.004, -0.006, 0.008)
    """Rotation vector that turns the axes of the head into those of the sensor [rad]."""
    pan_zero: float = 0.01
    """Reading of the pan encoder when the platform looks straight ahead [rad]."""
    tilt_zero: float = -0.015
    """Reading of the tilt encoder when the platform looks along the vehicle's x-y plane [rad]."""
    pan_limit: float = math.radians(90.0)
    """Pan readings stay within this of zero [rad]."""
    tilt_limit: float = math.radians(30.0)
    """Tilt readings stay within this of zero [rad]."""

    def __post_init__(self) -> None:
        for name in ("lever_arm", "head_offset", "misalignment"):
            value = np.asarray(getattr(self, name), np.float64)
            if value.shape != (3,) or not np.isfinite(value).all():
                raise InvalidInput(f"{name} must be three finite numbers, got {value.tolist()}")
        for name in ("pan_zero", "tilt_zero"):
            if not math.isfinite(getattr(self, name)):
                raise InvalidInput(f"{name} must be finite, got {getattr(self, name)} rad")
        require_positive("pan_limit", self.pan_limit, unit="rad")
        require_positive("tilt_limit", self.tilt_limit, unit="rad")

    def vehicle_from_sensor(self, pan: float, tilt: float) -> Pose:
        """Return the pose of the sensor at readings of the encoders.

        Parameters
        ----------
        pan : float [rad]
            Positive to the left.
        tilt : float [rad]
            Positive upwards.

        Raises
        ------
        InvalidInput
            A reading beyond the limits of the platform.
        """
        for name, angle, limit in (
            ("pan", pan, self.pan_limit),
            ("tilt", tilt, self.tilt_limit),
        ):
            if not abs(angle) <= limit + _ROUNDING:
                raise InvalidInput(f"{name} must lie within +-{limit} rad, got {angle} rad")
        head = exp_rotation(np.array([0.0, 0.0, pan - self.pan_zero])) @ exp_rotation(
            np.array([0.0, self.tilt_zero - tilt, 0.0])
        )
        return Pose(
            head @ exp_rotation(np.array(self.misalignment, np.float64)),
            np.array(self.lever_arm, np.float64) + head @ np.array(self.head_offset, np.float64),
        )


@dataclass(frozen=True, kw_only=True, slots=True)
class TiltSweep:
    """Where a platform looks over time: a fixed pan, and a tilt that is held or swings slowly."""

    pan: float = 0.0
    """Reading of the pan encoder, positive to the left [rad]."""
    tilt: float = 0.0
    """Middle of the swing, positive upwards [rad]."""
    swing: float = 0.0
    """How far the tilt swings to both sides [rad]; 0 holds it."""
    period: float = 8.0
    """How long a swing there and back takes [s]."""

    def __post_init__(self) -> None:
        for name in ("pan", "tilt"):
            if not math.isfinite(getattr(self, name)):
                raise InvalidInput(f"{name} must be finite, got {getattr(self, name)} rad")
        require_at_least("swing", self.swing, 0.0, unit="rad")
        require_positive("period", self.period, unit="s")

    def at(self, time: float) -> tuple[float, float]:
        """Return pan and tilt [rad] at a time [s]; the tilt is in the middle at time 0."""
        return self.pan, self.tilt + self.swing * math.sin(2.0 * math.pi * time / self.period)
