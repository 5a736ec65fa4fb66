"""Pairs of real scans with the pose between them, from the folder of real scans.

Each pair says how far its reference pose can be trusted. The folder is that of
``SCANLOCK_DATA`` or ``--data``; see docs for what it must hold.
"""

import json
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from scanlock.geometry.pose import Pose

Cloud = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class RealPair:
    """Two scans, the pose between them, and how good that pose is."""

    group: str
    name: str
    load_target: Callable[[], Cloud]
    load_source: Callable[[], Cloud]
    truth: Pose
    trusted_metres: float
    trusted_degrees: float


def kitti_drive(data: Path, apart: int) -> Iterator[RealPair]:
    folder = data / "kitti_drive_0005"
    pairs = json.loads((folder / "consensus_pairs.json").read_text())
    for key, pair in pairs.items():
        i, j = (int(index) for index in key.split("_"))
        if j - i == apart:
            yield RealPair(
                group=f"kitti_drive_0005, {apart} apart",
                name=f"{i}-{j}",
                load_target=partial(floats, _drive_file(folder, i), 4),
                load_source=partial(floats, _drive_file(folder, j), 4),
                truth=Pose.from_matrix(pair["T"]),
                trusted_metres=0.03,
                trusted_degrees=0.1,
            )


def kitti_00(data: Path, apart: int = 5) -> Iterator[RealPair]:
    folder = data / "kitti_00"
    rows = np.loadtxt(folder / "poses_velo_kissicp_ref.txt")
    poses = {int(row[0]): Pose.from_matrix(row[1:].reshape(3, 4)) for row in rows}
    scans = {i for i in poses if (folder / "velodyne" / f"{i:06d}.bin").exists()}
    for i in sorted(scans):
        if i + apart in scans:
            yield RealPair(
                group=f"kitti_00, {apart} apart",
                name=f"{i}-{i + apart}",
                load_target=partial(floats, folder / "velodyne" / f"{i:06d}.bin", 4),
                load_source=partial(floats, folder / "velodyne" / f"{i + apart:06d}.bin", 4),
                truth=poses[i].inverse() @ poses[i + apart],
                trusted_metres=0.03 * apart**0.5,
                trusted_degrees=0.2,
            )


def forest(data: Path) -> Iterator[RealPair]:
    folder = data / "forest_os1"
    for kind in ("still", "moving"):
        yield RealPair(
            group="forest_os1",
            name=kind,
            load_target=partial(floats, folder / f"{kind}_t0_xyzl.bin", 4),
            load_source=partial(floats, folder / f"{kind}_t1_xyzl.bin", 4),
            truth=Pose.from_matrix(np.loadtxt(folder / f"{kind}_reference_transform.txt")),
            trusted_metres=0.005,
            trusted_degrees=0.04,
        )


def hdl32(data: Path) -> Iterator[RealPair]:
    folder = data / "hdl32_pair"
    yield RealPair(
        group="hdl32_pair",
        name="campus",
        load_target=partial(ply_vertices, folder / "target.ply"),
        load_source=partial(ply_vertices, folder / "source.ply"),
        truth=Pose.from_matrix(np.loadtxt(folder / "T_target_source.txt")),
        trusted_metres=0.01,
        trusted_degrees=0.3,
    )


def argoverse(data: Path) -> Iterator[RealPair]:
    folder = data / "av2_pair"
    rows = np.loadtxt(folder / "poses_city_from_ego.txt")
    first, second = (Pose.from_matrix(row[1:].reshape(3, 4)) for row in rows)
    yield RealPair(
        group="av2_pair",
        name="city",
        load_target=partial(floats, folder / "000000.bin", 4),
        load_source=partial(floats, folder / "000001.bin", 4),
        truth=first.inverse() @ second,
        trusted_metres=0.003,
        trusted_degrees=0.05,
    )


def newer_college(data: Path) -> Iterator[RealPair]:
    folder = data / "newer_college" / "newer_01"
    poses: list[Pose] = []
    for line in (folder / "graph.txt").read_text().splitlines():
        numbers = np.array(line.split()[1:8], dtype=np.float64)
        poses.append(Pose(Rotation.from_quat(numbers[3:]).as_matrix(), numbers[:3]))
    for apart in range(1, 5):
        for i in range(5 - apart):
            yield RealPair(
                group=f"newer_01, {apart} apart",
                name=f"{i}-{i + apart}",
                load_target=partial(newer_scan, folder, i),
                load_source=partial(newer_scan, folder, i + apart),
                truth=poses[i].inverse() @ poses[i + apart],
                trusted_metres=0.05,
                trusted_degrees=0.3,
            )


def newer_scan(folder: Path, index: int) -> Cloud:
    name = f"{10 * index:06d}.bin"
    return np.vstack([floats(folder / f"planes_{name}", 3), floats(folder / f"edges_{name}", 3)])


def car_cloud(data: Path) -> Iterator[RealPair]:
    folder = data / "car_cloud_pair"
    yield RealPair(
        group="car_cloud_pair",
        name="parking",
        load_target=partial(text_numbers, folder / "car_cloud401.csv"),
        load_source=partial(text_numbers, folder / "car_cloud400.csv"),
        truth=Pose.from_matrix(np.loadtxt(folder / "reference_transform.txt")),
        trusted_metres=0.15,
        trusted_degrees=0.7,
    )


def handheld(data: Path, apart: int) -> Iterator[RealPair]:
    folder = data / "handheld_balm"
    poses = [Pose.from_matrix(row.reshape(3, 4)) for row in np.loadtxt(folder / "poses.txt")]
    for i in range(0, len(poses) - apart, 2):
        yield RealPair(
            group=f"handheld_balm, {apart} apart",
            name=f"{i}-{i + apart}",
            load_target=partial(floats, folder / "scans" / f"{i:06d}.bin", 3),
            load_source=partial(floats, folder / "scans" / f"{i + apart:06d}.bin", 3),
            truth=poses[i].inverse() @ poses[i + apart],
            trusted_metres=0.03,
            trusted_degrees=0.3,
        )


@cache
def floats(path: Path, columns: int) -> Cloud:
    return np.fromfile(path, np.float32).reshape(-1, columns)[:, :3].astype(np.float64)


@cache
def ply_vertices(path: Path) -> Cloud:
    from scanlock.io import read_scan

    return read_scan(path).points


@cache
def text_numbers(path: Path) -> Cloud:
    rows = [
        [float(number) for number in re.split(r"[,\s]+", line.strip())[:3]]
        for line in path.read_text().splitlines()
        if line.strip() and not line.lower().startswith("x")
    ]
    return np.array(rows)


def _drive_file(folder: Path, index: int) -> Path:
    return folder / "velodyne_points" / "data" / f"{index:010d}.bin"
