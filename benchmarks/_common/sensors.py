"""Real scans of many sensors, one by one, each with the angle between its beams."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from benchmarks._common import real_scans
from benchmarks._common.contenders import Cloud


@dataclass(frozen=True, kw_only=True)
class RealScan:
    """A real scan.

    Attributes
    ----------
    sensor : str
        Sensor and place.
    name : str
    load : callable
        Returns the (n, 3) points [m], in the sensor's frame.
    beam_spacing : float [deg]
        Typical angle between two beams; of scanners without beams, a width of bands.
    """

    sensor: str
    name: str
    load: Callable[[], Cloud]
    beam_spacing: float


_PCD_SPACINGS = {
    "40p": 0.35, "64": 1.0, "at128": 0.8, "ot128": 0.35, "qt128": 0.85, "qt64": 1.45, "vlp16": 2.0,
    "vlp32": 0.35, "xt16": 2.0, "xt32": 1.0, "xt32m": 1.3,
}  # fmt: skip
"""Angles between the beams [deg] of the scans in formats/pcd."""


def real_scans_of_many_sensors(data: Path) -> Iterator[RealScan]:
    """Yield 65 scans of some twenty sensors."""
    for sensor, spacing, files, columns in (
        ("HDL-64E, city", 0.42, [_drive(data, i) for i in range(0, 60, 4)], 4),
        ("HDL-64E, suburb", 0.42, [_suburb(data, i) for i in (0, 4, 8, 12, 94)], 4),
        ("OS1-64, forest", 0.5, sorted((data / "forest_os1").glob("*_xyzl.bin")), 4),
        ("handheld, 64 beams", 0.5, [_handheld(data, i) for i in range(0, 40, 4)], 3),
        ("OS1-64, quad", 0.5, sorted((data / "newer_college/newer_06").glob("raw_*.bin")), 3),
        ("two VLP-32C, city", 0.7, sorted((data / "av2_pair").glob("*.bin")), 4),
        ("OS1-64, off road", 0.5, [data / "rellis_offroad/000104.bin"], 4),
        ("VLP-32C, off road", 0.35, [data / "rellis_offroad/vel000104.bin"], 4),
    ):
        for file in files:
            load = partial(real_scans.floats.__wrapped__, file, columns)
            yield RealScan(sensor=sensor, name=file.stem, load=load, beam_spacing=spacing)
    for index in range(5):
        load = partial(real_scans.newer_scan, data / "newer_college/newer_01", index)
        yield RealScan(sensor="OS1-64, features", name=str(index), load=load, beam_spacing=0.5)
    yield from _other_files(data)


def _other_files(data: Path) -> Iterator[RealScan]:
    for name in ("target", "source"):
        load = partial(real_scans.ply_vertices, data / f"hdl32_pair/{name}.ply")
        yield RealScan(sensor="HDL-32E, campus", name=name, load=load, beam_spacing=1.33)
    for index in range(3):
        load = partial(real_scans.terrestrial_scan, data / f"terrestrial_3dtk/scan{index:03d}.3d")
        yield RealScan(sensor="terrestrial", name=str(index), load=load, beam_spacing=1.0)
    for file in sorted((data / "vtk").glob("*.vtk")):
        load = partial(real_scans.ply_vertices, file)
        yield RealScan(sensor="tilting, car park", name=file.stem, load=load, beam_spacing=1.0)
    for name, spacing in _PCD_SPACINGS.items():
        load = partial(real_scans.ply_vertices, data / f"formats/pcd/{name}.pcd")
        yield RealScan(sensor=name, name=name, load=load, beam_spacing=spacing)


def _drive(data: Path, index: int) -> Path:
    return data / "kitti_drive_0005/velodyne_points/data" / f"{index:010d}.bin"


def _suburb(data: Path, index: int) -> Path:
    return data / "kitti_00/velodyne" / f"{index:06d}.bin"


def _handheld(data: Path, index: int) -> Path:
    return data / "handheld_balm/scans" / f"{index:06d}.bin"
