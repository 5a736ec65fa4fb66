"""Models of lidars, with the numbers of their data sheets."""

import math

import numpy as np

from scanlock.arrays import Vector
from scanlock.simulation.sensors import Sensor

_GOLDEN = (math.sqrt(5.0) - 1.0) / 2.0

_VLP_32C = (
    (15.0, -1.4), (10.333, 1.4), (7.0, -1.4), (4.667, 1.4), (3.333, -1.4), (2.333, 1.4),
    (1.667, -4.2), (1.333, -1.4), (1.0, 1.4), (0.667, 4.2), (0.333, -4.2), (0.0, -1.4),
    (-0.333, 1.4), (-0.667, 4.2), (-1.0, -4.2), (-1.333, -1.4), (-1.667, 1.4), (-2.0, 4.2),
    (-2.333, -4.2), (-2.667, -1.4), (-3.0, 1.4), (-3.333, 4.2), (-3.667, -4.2), (-4.0, -1.4),
    (-4.667, 1.4), (-5.333, 4.2), (-6.148, -1.4), (-7.254, 1.4), (-8.843, -1.4), (-11.31, 1.4),
    (-15.639, -1.4), (-25.0, 1.4),
)  # fmt: skip
"""Elevation and clockwise azimuth offset of each beam, from the top [deg]."""


def hdl_64e() -> Sensor:
    """Return a Velodyne HDL-64E: 64 beams in two blocks, +2 to -24.8 degrees, 120 m.

    Returns
    -------
    Sensor
    """
    upper = np.linspace(2.0, 2.0 - 31.0 / 3.0, 32)
    lower = np.linspace(-8.83, -24.8, 32)
    elevations = np.concatenate([upper, lower])
    # Calibrated angles deviate from nominal ones by a few hundredths of a degree.
    elevations[1:-1] += 0.08 * (_scatter(62) - 0.5)
    # Neighbouring beams are in different columns of the optical block.
    offsets = np.tile([-0.06, 0.02, -0.02, 0.06], 16)
    return Sensor(
        name="hdl_64e",
        elevations=_radians(elevations),
        azimuth_offsets=_radians(offsets),
        azimuth_steps=2083,
        rate=10.0,
        min_range=0.9,
        max_range=120.0,
        range_noise=0.02,
    )


def hdl_32e() -> Sensor:
    """Return a Velodyne HDL-32E: 32 beams, +10.67 to -30.67 degrees, 70 m.

    Returns
    -------
    Sensor
    """
    return Sensor(
        name="hdl_32e",
        elevations=_radians(np.linspace(10.67, -30.67, 32)),
        azimuth_offsets=(0.0,) * 32,
        azimuth_steps=2170,
        rate=10.0,
        min_range=1.0,
        max_range=70.0,
        range_noise=0.02,
    )


def os1_64() -> Sensor:
    """Return an Ouster OS1-64: 64 beams over +-16.6 degrees in four staggered columns, 120 m.

    Returns
    -------
    Sensor
    """
    return Sensor(
        name="os1_64",
        elevations=_radians(np.linspace(16.6, -16.6, 64)),
        azimuth_offsets=_radians(np.tile([3.16, 1.05, -1.05, -3.16], 16)),
        azimuth_steps=1024,
        rate=10.0,
        min_range=0.8,
        max_range=120.0,
        range_noise=0.03,
    )


def vlp_16() -> Sensor:
    """Return a Velodyne VLP-16: 16 beams, +15 to -15 degrees, 100 m.

    The numbers are those of the Velodyne VLP-16 data sheet (63-9229): 2 degrees between beams, 0.2
    degrees between firings at 10 Hz, and an accuracy of +-3 cm.

    Returns
    -------
    Sensor
    """
    return Sensor(
        name="vlp_16",
        elevations=_radians(np.linspace(15.0, -15.0, 16)),
        azimuth_offsets=(0.0,) * 16,
        azimuth_steps=1800,
        rate=10.0,
        min_range=0.5,
        max_range=100.0,
        range_noise=0.02,
    )


def vlp_32c() -> Sensor:
    """Return a Velodyne VLP-32C: 32 unevenly spaced beams, +15 to -25 degrees, 200 m.

    The numbers are those of the Velodyne VLP-32C user manual (63-9325): beams 0.333 degrees apart
    near the horizon, four columns of the optical block, and an accuracy of +-3 cm.

    Returns
    -------
    Sensor
    """
    elevations, clockwise = np.array(_VLP_32C).T
    return Sensor(
        name="vlp_32c",
        elevations=_radians(elevations),
        azimuth_offsets=_radians(-clockwise),
        azimuth_steps=1800,
        rate=10.0,
        min_range=1.0,
        max_range=200.0,
        range_noise=0.02,
    )


def os1_128() -> Sensor:
    """Return an Ouster OS1-128: 128 beams over +-22.5 degrees in four staggered columns, 120 m.

    The numbers are those of the Ouster OS1 data sheet (Gen 2): 45 degrees of elevation, 120 m at a
    reflectivity of 80 %, and a precision of 0.7 to 5 cm.

    Returns
    -------
    Sensor
    """
    return Sensor(
        name="os1_128",
        elevations=_radians(np.linspace(22.5, -22.5, 128)),
        azimuth_offsets=_radians(np.tile([4.23, 1.41, -1.41, -4.23], 32)),
        azimuth_steps=1024,
        rate=10.0,
        min_range=0.3,
        max_range=120.0,
        range_noise=0.02,
    )


def os0_128() -> Sensor:
    """Return an Ouster OS0-128: 128 beams over +-45 degrees, 50 m.

    The numbers are those of the Ouster OS0 data sheet (Gen 2): 90 degrees of elevation, 50 m at a
    reflectivity of 80 %, and a precision of 1.5 to 5 cm. All beams are in one column here.

    Returns
    -------
    Sensor
    """
    return Sensor(
        name="os0_128",
        elevations=_radians(np.linspace(45.0, -45.0, 128)),
        azimuth_offsets=(0.0,) * 128,
        azimuth_steps=1024,
        rate=10.0,
        min_range=0.3,
        max_range=50.0,
        range_noise=0.03,
    )


def livox_avia() -> Sensor:
    """Return a raster with the field of view of a Livox Avia: 70.4 x 77.2 degrees, 190 m.

    The numbers are those of the Livox Avia user manual: 240,000 points per second, 190 m at a
    reflectivity of 10 %, and a precision of 2 cm. Half a second of its rosette is a raster of 300
    columns and 400 rows here.

    Returns
    -------
    Sensor
    """
    return Sensor(
        name="livox_avia",
        elevations=_radians(np.linspace(38.6, -38.6, 400)),
        azimuth_offsets=(0.0,) * 400,
        azimuth_steps=300,
        rate=2.0,
        min_range=1.0,
        max_range=190.0,
        range_noise=0.02,
        width=math.radians(70.4),
    )


SENSORS = {
    "hdl_64e": hdl_64e,
    "hdl_32e": hdl_32e,
    "os1_64": os1_64,
    "vlp_16": vlp_16,
    "vlp_32c": vlp_32c,
    "os1_128": os1_128,
    "os0_128": os0_128,
    "livox_avia": livox_avia,
}
"""Functions that return the sensors, by name."""


def _scatter(count: int) -> Vector:
    """Return fixed, evenly distributed numbers in [0, 1)."""
    return (np.arange(1, count + 1, dtype=np.float64) * _GOLDEN) % 1.0


def _radians(degrees: Vector) -> tuple[float, ...]:
    return tuple(float(angle) for angle in np.radians(degrees))
