"""Accuracy of an estimated pose: standard deviations at one point, along named axes."""

import math
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from scanlock.arrays import Vector, frozen
from scanlock.registration.uncertainty.pose_covariance import PoseCovariance

AxisNames = tuple[str, str, str]
"""Names of the x, y and z axes."""

MAP_AXES: AxisNames = ("east", "north", "up")
"""Axes of map coordinates."""

SENSOR_AXES: AxisNames = ("forward", "left", "up")
"""Axes of a sensor that looks along x."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class PoseAccuracy:
    """Standard deviations of an estimated pose at the centroid of the overlap.

    Build with `PoseAccuracy.of`. Printed, it is one sentence.

    Attributes
    ----------
    point : (3,) [m]
        Point of the source at which the deviations hold, in the caller's coordinates: the
        centroid of the surfaces that both scans share.
    axes : tuple of str
        Names of the axes: east, north, up of a map, or forward, left, up of the source's sensor.
    translation : (3,) [m]
        Standard deviations of the position of `point` along the axes.
    rotation : (3,) [rad]
        Standard deviations of the rotation about the axes.
    """

    point: Vector
    axes: AxisNames
    translation: Vector
    rotation: Vector

    def __post_init__(self) -> None:
        for array in (self.point, self.translation, self.rotation):
            frozen(array)

    @classmethod
    def of(
        cls, covariance: PoseCovariance, point: Vector, frame: Literal["map", "sensor"]
    ) -> "PoseAccuracy":
        """Return the accuracy at a point (3,) of the source [m].

        Parameters
        ----------
        covariance : PoseCovariance
        point : (3,) [m]
            In the caller's coordinates of the source.
        frame : str
            ``"map"``: along the axes of the target; ``"sensor"``: along those of the source.
        """
        turn = np.eye(3) if frame == "map" else covariance.pose.rotation
        translation, rotation = covariance.point_covariance(point), covariance.matrix[3:, 3:]
        return cls(
            point=np.array(point, np.float64),
            axes=MAP_AXES if frame == "map" else SENSOR_AXES,
            translation=np.sqrt(np.diag(turn.T @ translation @ turn)),
            rotation=np.sqrt(np.diag(turn.T @ rotation @ turn)),
        )

    @property
    def position_deviation(self) -> float:
        """Standard deviation of the position [m], root mean square over the axes."""
        return math.sqrt(float(np.mean(self.translation**2)))

    @property
    def rotation_deviation(self) -> float:
        """Standard deviation of the rotation [rad], root mean square over the axes."""
        return math.sqrt(float(np.mean(self.rotation**2)))

    @property
    def weakest_axis(self) -> str:
        """Name of the axis with the largest deviation of the position."""
        return self.axes[int(np.argmax(self.translation))]

    def details(self) -> str:
        """Return the deviations of every axis as text, in millimetres and degrees."""
        unit, factor = _length_unit(float(self.translation.max()))
        pairs = zip(self.axes, factor * self.translation, strict=True)
        lengths = ", ".join(f"{name} {_digits(value)}" for name, value in pairs)
        turns = ", ".join(
            f"{name} {_digits(value)}"
            for name, value in zip(self._rotation_names, np.degrees(self.rotation), strict=True)
        )
        return f"{lengths} {unit}; {turns} deg"

    def as_dict(self) -> dict[str, Any]:
        """Return the accuracy as plain numbers and text, ready for JSON."""
        return {
            "point": self.point.tolist(),
            "translation_m": dict(zip(self.axes, self.translation.tolist(), strict=True)),
            "rotation_deg": dict(
                zip(self._rotation_names, np.degrees(self.rotation).tolist(), strict=True)
            ),
        }

    @property
    def _rotation_names(self) -> AxisNames:
        if self.axes == SENSOR_AXES:
            return "roll", "pitch", "yaw"
        first, second, third = self.axes
        return f"about {first}", f"about {second}", f"about {third}"

    def __str__(self) -> str:
        return (
            f"{length_text(self.position_deviation)} and "
            f"{_digits(math.degrees(self.rotation_deviation))} deg at one sigma, weakest "
            f"{self.weakest_axis}, {length_text(float(self.translation.max()))}"
        )

    def __repr__(self) -> str:
        return f"PoseAccuracy({self.details()})"

    def __reduce__(self) -> tuple[Any, ...]:
        arrays = (self.point, self.translation, self.rotation)
        return _rebuilt, (self.axes, *(np.array(one) for one in arrays))


def _rebuilt(axes: AxisNames, point: Vector, translation: Vector, rotation: Vector) -> PoseAccuracy:
    return PoseAccuracy(point=point, axes=axes, translation=translation, rotation=rotation)


def length_text(metres: float) -> str:
    """Return a small length with two significant digits: in millimetres, or in metres from 1 m."""
    unit, factor = _length_unit(metres)
    return f"{_digits(factor * metres)} {unit}"


def _length_unit(metres: float) -> tuple[str, float]:
    return ("mm", 1e3) if metres < 0.9995 else ("m", 1.0)


def _digits(value: float) -> str:
    """Return a number with two significant digits and without an exponent."""
    if not 0.0 < value < math.inf:
        return f"{value:g}"
    places = max(0, 1 - math.floor(math.log10(value)))
    return f"{value:.{places}f}"
