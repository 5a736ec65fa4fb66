"""Pairs of real scans with reference poses, read from the folder of real scans.

The folder is ``--data`` or the environment variable SCANLOCK_DATA. docs/benchmarks.md states the
accuracy of the references.
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
    """Two scans and the reference pose of the source in the target."""

    group: str
    name: str
    load_target: Callable[[], Cloud]
    load_source: Callable[[], Cloud]
    truth: Pose


def kitti_drive(data: Path, step: int) -> Iterator[RealPair]:
    """Yield pairs of a city drive (HDL-64E) with consensus poses."""
    folder = data / "kitti_drive_0005"
    pairs = json.loads((folder / "consensus_pairs.json").read_text())
    for key, pair in pairs.items():
        i, j = (int(index) for index in key.split("_"))
        if j - i == step:
            yield RealPair(
                group=f"kitti_drive_0005, {step} apart",
                name=f"{i}-{j}",
                load_target=partial(floats, _drive_file(folder, i), 4),
                load_source=partial(floats, _drive_file(folder, j), 4),
                truth=Pose.from_matrix(pair["T"]),
            )


def kitti_drive_far(data: Path, step: int, every: int = 2) -> Iterator[RealPair]:
    """Yield pairs beyond the range of the consensus, with chained poses."""
    folder = data / "kitti_drive_0005"
    rows = np.loadtxt(folder / "consensus_chain.txt")
    poses = [Pose.from_matrix(row.reshape(3, 4)) for row in rows]
    for i in range(0, len(poses) - step, every):
        yield RealPair(
            group=f"kitti_drive_0005, {step} apart",
            name=f"{i}-{i + step}",
            load_target=partial(floats, _drive_file(folder, i), 4),
            load_source=partial(floats, _drive_file(folder, i + step), 4),
            truth=poses[i].inverse() @ poses[i + step],
        )


def kitti_00(data: Path, step: int = 5) -> Iterator[RealPair]:
    """Yield pairs of a suburban drive (HDL-64E) with poses of KISS-ICP."""
    folder = data / "kitti_00"
    rows = np.loadtxt(folder / "poses_velo_kissicp_ref.txt")
    poses = {int(row[0]): Pose.from_matrix(row[1:].reshape(3, 4)) for row in rows}
    scans = {i for i in poses if (folder / "velodyne" / f"{i:06d}.bin").exists()}
    for i in sorted(scans):
        if i + step in scans:
            yield RealPair(
                group=f"kitti_00, {step} apart",
                name=f"{i}-{i + step}",
                load_target=partial(floats, folder / "velodyne" / f"{i:06d}.bin", 4),
                load_source=partial(floats, folder / "velodyne" / f"{i + step:06d}.bin", 4),
                truth=poses[i].inverse() @ poses[i + step],
            )


def forest(data: Path) -> Iterator[RealPair]:
    """Yield two pairs under canopy (OS1)."""
    folder = data / "forest_os1"
    for kind in ("still", "moving"):
        yield RealPair(
            group="forest_os1",
            name=kind,
            load_target=partial(floats, folder / f"{kind}_t0_xyzl.bin", 4),
            load_source=partial(floats, folder / f"{kind}_t1_xyzl.bin", 4),
            truth=Pose.from_matrix(np.loadtxt(folder / f"{kind}_reference_transform.txt")),
        )


def hdl32(data: Path) -> Iterator[RealPair]:
    """Yield one pair on a campus (HDL-32E)."""
    folder = data / "hdl32_pair"
    yield RealPair(
        group="hdl32_pair",
        name="campus",
        load_target=partial(ply_vertices, folder / "target.ply"),
        load_source=partial(ply_vertices, folder / "source.ply"),
        truth=Pose.from_matrix(np.loadtxt(folder / "T_target_source.txt")),
    )


def argoverse(data: Path) -> Iterator[RealPair]:
    """Yield one pair of Argoverse 2 (two VLP-32C)."""
    folder = data / "av2_pair"
    rows = np.loadtxt(folder / "poses_city_from_ego.txt")
    first, second = (Pose.from_matrix(row[1:].reshape(3, 4)) for row in rows)
    yield RealPair(
        group="av2_pair",
        name="city",
        load_target=partial(floats, folder / "000000.bin", 4),
        load_source=partial(floats, folder / "000001.bin", 4),
        truth=first.inverse() @ second,
    )


def newer_college(data: Path) -> Iterator[RealPair]:
    """Yield ten pairs on a college quad (OS1-64) with pose graph poses."""
    folder = data / "newer_college" / "newer_01"
    poses: list[Pose] = []
    for line in (folder / "graph.txt").read_text().splitlines():
        numbers = np.array(line.split()[1:8], dtype=np.float64)
        poses.append(Pose(Rotation.from_quat(numbers[3:]).as_matrix(), numbers[:3]))
    for step in range(1, 5):
        for i in range(5 - step):
            yield RealPair(
                group=f"newer_01, {step} apart",
                name=f"{i}-{i + step}",
                load_target=partial(newer_scan, folder, i),
                load_source=partial(newer_scan, folder, i + step),
                truth=poses[i].inverse() @ poses[i + step],
            )


def newer_scan(folder: Path, index: int) -> Cloud:
    """Return the plane and edge features of a scan."""
    name = f"{10 * index:06d}.bin"
    return np.vstack([floats(folder / f"planes_{name}", 3), floats(folder / f"edges_{name}", 3)])


def car_cloud(data: Path) -> Iterator[RealPair]:
    """Yield one pair in a car park."""
    folder = data / "car_cloud_pair"
    yield RealPair(
        group="car_cloud_pair",
        name="parking",
        load_target=partial(text_numbers, folder / "car_cloud401.csv"),
        load_source=partial(text_numbers, folder / "car_cloud400.csv"),
        truth=Pose.from_matrix(np.loadtxt(folder / "reference_transform.txt")),
    )


def handheld(data: Path, step: int) -> Iterator[RealPair]:
    """Yield every second pair of a handheld sequence with refined poses."""
    folder = data / "handheld_balm"
    poses = [Pose.from_matrix(row.reshape(3, 4)) for row in np.loadtxt(folder / "poses.txt")]
    for i in range(0, len(poses) - step, 2):
        yield RealPair(
            group=f"handheld_balm, {step} apart",
            name=f"{i}-{i + step}",
            load_target=partial(floats, folder / "scans" / f"{i:06d}.bin", 3),
            load_source=partial(floats, folder / "scans" / f"{i + step:06d}.bin", 3),
            truth=poses[i].inverse() @ poses[i + step],
        )


def terrestrial(data: Path) -> Iterator[RealPair]:
    """Yield three pairs in an indoor corridor (terrestrial scanner, files of 3DTK)."""
    folder = data / "terrestrial_3dtk"
    for i, j in ((0, 1), (1, 2), (0, 2)):
        yield RealPair(
            group="terrestrial_3dtk",
            name=f"{i}-{j}",
            load_target=partial(terrestrial_scan, folder / f"scan{i:03d}.3d"),
            load_source=partial(terrestrial_scan, folder / f"scan{j:03d}.3d"),
            truth=_terrestrial_pose(folder, i).inverse() @ _terrestrial_pose(folder, j),
        )


def rellis(data: Path) -> Iterator[RealPair]:
    """Yield one pair of two sensors on one vehicle, rotated by the calibration."""
    folder = data / "rellis_offroad"
    text = (folder / "vel2os1.yaml").read_text()
    w, x, y, z, *translation = (float(number) for number in re.findall(r": ([-0-9.e]+)", text))
    os1_from_velodyne = Pose(Rotation.from_quat([x, y, z, w]).as_matrix(), np.array(translation))
    turn = Pose(os1_from_velodyne.rotation, np.zeros(3))
    yield RealPair(
        group="rellis_offroad, turned",
        name="OS1-Velodyne",
        load_target=partial(floats, folder / "000104.bin", 4),
        load_source=lambda: turn.apply(floats(folder / "vel000104.bin", 4)),
        truth=os1_from_velodyne @ turn.inverse(),
    )


@cache
def terrestrial_scan(path: Path) -> Cloud:
    """Return the points of a file of 3DTK: centimetres, x right, y up, z forward, left-handed."""
    right, up, forward = np.loadtxt(path, usecols=(0, 1, 2)).T / 100.0
    return np.column_stack([forward, -right, up])


def _terrestrial_pose(folder: Path, index: int) -> Pose:
    numbers = np.loadtxt(folder / f"scan{index:03d}.pose")
    ours_from_theirs = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    # Rotations about x, y, z in this order; the change of axes makes it right-handed.
    turn = Rotation.from_euler("XYZ", numbers[1], degrees=True).as_matrix()
    return Pose(ours_from_theirs @ turn @ ours_from_theirs.T, ours_from_theirs @ numbers[0] / 100.0)


@cache
def floats(path: Path, columns: int) -> Cloud:
    """Return x, y, z of a file of float32 rows."""
    return np.fromfile(path, np.float32).reshape(-1, columns)[:, :3].astype(np.float64)


@cache
def ply_vertices(path: Path) -> Cloud:
    """Return the points of a PLY file."""
    from scanlock.io import read_scan

    return read_scan(path).points


@cache
def text_numbers(path: Path) -> Cloud:
    """Return the first three columns of a text file with a header."""
    rows = [
        [float(number) for number in re.split(r"[,\s]+", line.strip())[:3]]
        for line in path.read_text().splitlines()
        if line.strip() and not line.lower().startswith("x")
    ]
    return np.array(rows)


def _drive_file(folder: Path, index: int) -> Path:
    return folder / "velodyne_points" / "data" / f"{index:010d}.bin"
