import numpy as np
import pytest


def _box_ranges(directions, half=(20.0, 12.0), floor=-1.7, ceiling=6.0):
    with np.errstate(divide="ignore"):
        ranges = [
            np.where(directions[:, 0] != 0, half[0] / np.abs(directions[:, 0]), np.inf),
            np.where(directions[:, 1] != 0, half[1] / np.abs(directions[:, 1]), np.inf),
            np.where(directions[:, 2] < 0, floor / directions[:, 2], np.inf),
            np.where(directions[:, 2] > 0, ceiling / directions[:, 2], np.inf),
        ]
    return np.min(ranges, axis=0)


@pytest.fixture(scope="session")
def room_scan():
    """Return a function that simulates a scan of a box-shaped room by a spinning lidar."""

    def make(beams=16, steps=360, order="ring"):
        elevations = np.radians(np.linspace(-15.0, 15.0, beams))
        azimuths = -np.pi + 2 * np.pi * (np.arange(steps) + 0.31) / steps
        grid = np.meshgrid(elevations, azimuths, indexing="ij")
        if order == "column":
            grid = [angles.T for angles in grid]
        elevation, azimuth = (angles.ravel() for angles in grid)
        directions = np.stack(
            [
                np.cos(elevation) * np.cos(azimuth),
                np.cos(elevation) * np.sin(azimuth),
                np.sin(elevation),
            ],
            axis=1,
        )
        return directions * _box_ranges(directions)[:, None]

    return make


@pytest.fixture
def save(tmp_path):
    """Return a function that writes bytes or text to a named file and returns its path."""

    def write(name, content):
        path = tmp_path / name
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    return write
