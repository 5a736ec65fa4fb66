"""Pan/tilt platform: pose of a sensor on a vehicle from encoder readings."""

import math
from dataclasses import dataclass

import numpy as np

from scanlock.errors import InvalidInput, require_at_least, require_positive
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import exp_rotation

_ROUNDING = 1e-9
"""Tolerance of the limits for rounding, as in conversions from degrees [rad]."""


@dataclass(frozen=True, kw_only=True, slots=True)
class PanTiltMount:
    """A platform that pans about the z axis of the vehicle and tilts about the panned y axis.

    Encoder readings are converted to a pose by lever arms and calibration. Madhavan and Messina
    (2003) mention a mount position and calibration factors, and give a tilt of +-30 degrees; all
    other values are ours.
    """

    lever_arm: tuple[float, float, float] = (0.8, 0.0, 0.25)
    """Intersection of the pan and the tilt axis, in the frame of the vehicle [m]."""
    head_offset: tuple[float, float, float] = (0.12, 0.0, 0.1)
    """Origin of the sensor in the frame of the head, from that intersection [m]."""
    misalignment: tuple[float, float, float] = (0.004, -0.006, 0.008)
    """Rotation vector from the axes of the head to those of the sensor [rad]."""
    pan_zero: float = 0.01
    """Reading of the pan encoder for the direction straight ahead [rad]."""
    tilt_zero: float = -0.015
    """Reading of the tilt encoder for directions in the x-y plane of the vehicle [rad]."""
    pan_limit: float = math.radians(90.0)
    """Maximum absolute pan reading [rad]."""
    tilt_limit: float = math.radians(30.0)
    """Maximum absolute tilt reading [rad]."""

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
        """Compute the pose of the sensor from encoder readings.

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
                raise InvalidInput(f"{name} must be within +-{limit} rad, got {angle} rad")
        head = exp_rotation(np.array([0.0, 0.0, pan - self.pan_zero])) @ exp_rotation(
            np.array([0.0, self.tilt_zero - tilt, 0.0])
        )
        return Pose(
            head @ exp_rotation(np.array(self.misalignment, np.float64)),
            np.array(self.lever_arm, np.float64) + head @ np.array(self.head_offset, np.float64),
        )


@dataclass(frozen=True, kw_only=True, slots=True)
class TiltSweep:
    """Motion of a platform over time: a fixed pan, and a fixed or slowly oscillating tilt."""

    pan: float = 0.0
    """Reading of the pan encoder, positive to the left [rad]."""
    tilt: float = 0.0
    """Mean reading of the tilt encoder, positive upwards [rad]."""
    swing: float = 0.0
    """Amplitude of the oscillation of the tilt [rad]; 0 for a fixed tilt."""
    period: float = 8.0
    """Period of the oscillation [s]."""

    def __post_init__(self) -> None:
        for name in ("pan", "tilt"):
            if not math.isfinite(getattr(self, name)):
                raise InvalidInput(f"{name} must be finite, got {getattr(self, name)} rad")
        require_at_least("swing", self.swing, 0.0, unit="rad")
        require_positive("period", self.period, unit="s")

    def at(self, time: float) -> tuple[float, float]:
        """Return pan and tilt [rad] at a time [s]; at time 0 the tilt has its mean value."""
        return self.pan, self.tilt + self.swing * math.sin(2.0 * math.pi * time / self.period)
