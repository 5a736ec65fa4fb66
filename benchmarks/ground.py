"""Ground segmentation against references: precision, recall, F1 and time.

    python benchmarks/ground.py --data FOLDER

FOLDER (default: the environment variable SCANLOCK_DATA) holds the real scans; cases whose files
are missing are left out. One protocol for all methods: every point of a cloud is decided; points
whose reference is unknown are not judged; precision, recall and F1 count points. A method that
cannot find the sensor's height is told it (the column "told").
"""

import argparse
import json
import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from real_scans import kitti_drive
from scanlock.clouds.point_cloud import PointCloud
from scanlock.segmentation.ground.finder import GroundDetector, GroundFinder, PublishedGroundFinder
from scanlock.simulation.objects.surface_class import SurfaceClass
from scanlock.simulation.scan import simulate_scan
from scanlock.simulation.sensors import SENSORS
from scanlock.simulation.sequence import SCENES
from tables import machine, print_table

Answer = Callable[[], np.ndarray]

_REPEATS = 7
_RELLIS_GROUND = (1, 3, 10, 23, 31, 33)  # dirt, grass, asphalt, concrete, puddle, mud
_RELLIS_VOID = 0


@dataclass(frozen=True)
class Case:
    """One cloud, which of its points are ground, and which of them the reference decides."""

    name: str
    points: np.ndarray
    ground: np.ndarray
    judged: np.ndarray
    max_range: float | None = None
    told: float | None = None

    @property
    def height(self) -> float:
        """Height of the origin above the reference ground near it, unless told [m]."""
        if self.told is not None:
            return self.told
        ground = self.points[self.ground & self.judged]
        reach = np.hypot(ground[:, 0], ground[:, 1])
        near = reach <= max(10.0, np.partition(reach, min(200, len(reach) - 1))[:200].max())
        return -float(np.median(ground[near, 2]))


def cases(data: Path) -> Iterator[Case]:
    for reader in (_rellis, _av2, _forest, _airborne):
        yield from reader(data)
    yield from _simulated()


def _rellis(data: Path) -> Iterator[Case]:
    """RELLIS-3D: class ids, void not judged; the Velodyne takes those of the nearest OS1 point."""
    folder = data / "rellis_offroad"
    if not folder.is_dir():
        return
    xyz = np.fromfile(folder / "000104.bin", np.float32).reshape(-1, 4)[:, :3].astype(float)
    label = np.fromfile(folder / "000104.label", np.uint32)
    real = np.abs(xyz).max(axis=1) > 0
    xyz, label = xyz[real], label[real]
    ground, judged = np.isin(label, _RELLIS_GROUND), label != _RELLIS_VOID
    yield Case("RELLIS OS1", xyz, ground, judged)

    other = np.fromfile(folder / "vel000104.bin", np.float32).reshape(-1, 4)[:, :3].astype(float)
    other = other[np.isfinite(other).all(axis=1) & (np.abs(other).max(axis=1) > 0)]
    # vel2os1.yaml: half a turn about z and a shift, to 0.03 degrees.
    in_os1 = other * [-1, -1, 1] + [-0.25209722874775564, 0.0010963734677, -0.09197253613570998]
    distance, nearest = cKDTree(xyz).query(in_os1)
    yield Case("RELLIS Velodyne", other, ground[nearest], judged[nearest] & (distance < 0.2))


def _av2(data: Path) -> Iterator[Case]:
    """Argoverse 2: ground is what lies at most 0.3 m above the data set's terrain raster."""
    folder = data / "av2_pair"
    if not folder.is_dir():
        return
    raster = np.load(next(folder.glob("*ground_height*.npy"))).astype(float)
    sim2 = json.loads(next(folder.glob("*Sim2*.json")).read_text())
    poses = np.loadtxt(folder / "poses_city_from_ego.txt")
    for row in poses:
        scan = folder / f"{int(row[0]):06d}.bin"
        xyz = np.fromfile(scan, np.float32).reshape(-1, 4)[:, :3].astype(float)
        city = xyz @ row[1:].reshape(3, 4)[:, :3].T + row[1:].reshape(3, 4)[:, 3]
        turn = np.array(sim2["R"]).reshape(2, 2)
        cell = ((city[:, :2] @ turn.T + sim2["t"]) * sim2["s"]).astype(int)
        inside = ((cell >= 0) & (cell < raster.shape[::-1])).all(axis=1)
        cell[~inside] = 0
        terrain = np.where(inside, raster[cell[:, 1], cell[:, 0]], np.nan)
        yield Case(f"AV2 {int(row[0])}", xyz, city[:, 2] < terrain + 0.3, np.isfinite(terrain))


def _forest(data: Path) -> Iterator[Case]:
    """Under canopy: the labels mark stems (1) and all the rest (0), leaves included.

    Stems are judged as not ground; of the rest, what lies within 0.3 m of the lowest point in a
    square of 1 m with at least 5 points below the stems' feet is judged as ground.
    """
    for scan in sorted((data / "forest_os1").glob("*_xyzl.bin")):
        raw = np.fromfile(scan, np.float32).reshape(-1, 4)
        raw = raw[np.abs(raw[:, :3]).max(axis=1) > 0]
        xyz, stem = raw[:, :3].astype(float), raw[:, 3] == 1
        terrain = _terrain_under(xyz)
        above = xyz[:, 2] - terrain
        ground = ~stem & (above < 0.3)
        yield Case(
            f"forest {scan.name[:-9]}",
            xyz,
            ground,
            np.isfinite(above) & (stem | (above > 1) | ground),
        )


def _terrain_under(xyz: np.ndarray) -> np.ndarray:
    """Return the median of the cell minima in 5 x 5 squares of 1 m, NaN with fewer than five."""
    cell = np.floor(xyz[:, :2]).astype(int)
    cell -= cell.min(axis=0)
    low = np.full(cell.max(axis=0) + 5, np.inf)
    np.minimum.at(low, (cell[:, 0] + 2, cell[:, 1] + 2), xyz[:, 2])
    low[np.isinf(low)] = np.nan
    windows = np.lib.stride_tricks.sliding_window_view(low, (5, 5)).reshape(*(cell.max(0) + 1), 25)
    few = np.isfinite(windows).sum(axis=-1) < 5
    terrain = np.where(few, np.nan, np.nanpercentile(np.where(few[..., None], 0, windows), 30, -1))
    return terrain[cell[:, 0], cell[:, 1]]


def _airborne(data: Path) -> Iterator[Case]:
    """Classified airborne tiles, about the middle of the tile; there is no sensor position.

    ASPRS class 2 is ground; other points are judged, as not ground, from 0.5 m above its
    triangulation on, because class 2 is thinned and much of the ground beside it is left in
    class 1. Water (9) is not judged.
    """
    import laspy
    from scipy.interpolate import LinearNDInterpolator

    for name, metres in (
        ("MixedConifer.laz", 1.0),
        ("Topography.laz", 1.0),
        ("autzen_trim.laz", 0.3048),
    ):
        path = data / "formats" / "las" / name
        if not path.exists():
            continue
        tile = laspy.read(path)
        xyz = np.asarray(tile.xyz) * metres
        xyz = xyz - np.round((xyz.min(axis=0) + xyz.max(axis=0)) / 2)
        kind = np.asarray(tile.classification)
        reach = float(np.ceil(np.hypot(xyz[:, 0], xyz[:, 1]).max()))
        ground = kind == 2
        terrain = LinearNDInterpolator(xyz[ground, :2], xyz[ground, 2])(xyz[:, :2])
        judged = ground | ((xyz[:, 2] - terrain > 0.5) & (kind != 9))
        yield Case(f"airborne {path.stem}", xyz, ground, judged, max_range=reach)


def _simulated() -> Iterator[Case]:
    """Streets and forests with exact labels: kerbs are ground, blades of grass not judged."""
    for scene_name, make_scene in SCENES.items():
        rng = np.random.default_rng(7)
        scene = make_scene(rng)
        drive = scene.drive(rng, count=3, spacing=120.0)
        for sensor_name in ("hdl_64e", "hdl_32e"):
            for k in range(len(drive)):
                sensor = SENSORS[sensor_name]()
                scan = simulate_scan(
                    scene.world, sensor, drive.poses[k], rng, time=float(drive.times[k])
                )
                ground = np.isin(scan.labels, (SurfaceClass.GROUND, SurfaceClass.KERB))
                judged = scan.labels != SurfaceClass.GRASS
                yield Case(f"{scene_name} {sensor_name} {k}", scan.points, ground, judged)


def scores(case: Case, is_ground: np.ndarray) -> tuple[float, float, float]:
    """Return precision, recall and F1 over the judged points."""
    said, truth = is_ground[case.judged], case.ground[case.judged]
    hits = float((said & truth).sum())
    precision = hits / max(said.sum(), 1)
    recall = hits / max(truth.sum(), 1)
    return precision, recall, 2 * precision * recall / max(precision + recall, 1e-12)


def milliseconds(call: Callable[[], object]) -> float:
    """Return the median processor time of a call after one to warm up."""
    call()
    times: list[float] = []
    for _ in range(_REPEATS):
        start = time.process_time()
        call()
        times.append(time.process_time() - start)
    return 1e3 * float(np.median(times))


def methods(case: Case) -> Iterator[tuple[str, Answer, Answer]]:
    """Yield each method by name, as a call to be judged and a call to be timed."""
    cloud = PointCloud.from_array(case.points)
    for name, finder in (("scanlock", GroundFinder()), ("das2013", PublishedGroundFinder())):
        if case.max_range is not None:
            finder = replace(finder, grid=replace(finder.grid, max_range=case.max_range))
        call = partial(_found, finder, cloud)
        yield name, call, call
    if find_spec("pypatchworkpp") is not None:
        # Its thresholds adapt from scan to scan and these are no sequence: judged when fresh.
        xyz = np.ascontiguousarray(case.points, dtype=np.float32)
        fresh, used = _patchwork(case), _patchwork(case)
        yield "patchworkpp", partial(_patched, fresh, xyz), partial(_patched, used, xyz)


def _found(finder: GroundDetector, cloud: PointCloud) -> np.ndarray:
    return finder.find(cloud).is_ground


def _patchwork(case: Case) -> object:
    import pypatchworkpp

    parameters = pypatchworkpp.Parameters()
    parameters.sensor_height = case.height
    parameters.enable_RNR = False  # needs intensities on the scale of one sensor
    if case.max_range is not None:
        parameters.max_range = case.max_range
    with _quiet():
        return pypatchworkpp.patchworkpp(parameters)


def _patched(finder: object, xyz: np.ndarray) -> np.ndarray:
    finder.estimateGround(xyz)
    is_ground = np.zeros(len(xyz), dtype=bool)
    is_ground[finder.getGroundIndices()] = True
    return is_ground


@contextmanager
def _quiet() -> Iterator[None]:
    """Silence what compiled code writes to the standard output."""
    sys.stdout.flush()
    kept = os.dup(1)
    with open(os.devnull, "w") as nowhere:
        os.dup2(nowhere.fileno(), 1)
        try:
            yield
        finally:
            os.dup2(kept, 1)
            os.close(kept)


def agreement(data: Path, apart: int = 10, every: int = 7) -> Iterator[tuple[str, float, float]]:
    """Yield what share of the points of one scan keep their answer in another, for each method.

    Two scans of the drive, `apart` apart, are brought together by their consensus pose; a point
    and the nearest one of the other scan within 0.2 m should have the same answer. The second
    number is the same over the points between 0.3 and 2 m above the base plane of the default.
    """
    totals: dict[str, list[tuple[float, float]]] = {}
    for pair in list(kitti_drive(data, apart))[::every]:
        clouds = pair.load_target(), pair.load_source()
        told = [Case("", points, np.zeros(0), np.zeros(0), told=1.79) for points in clouds]
        gap, nearest = cKDTree(clouds[0]).query(pair.truth.apply(clouds[1]), workers=1)
        met = gap < 0.2
        plane = GroundFinder().find(PointCloud.from_array(clouds[1])).plane
        above = clouds[1] @ plane[:3] + plane[3]
        raised = met & (above > 0.3) & (above < 2.0)
        for (name, first, _), (_, second, _) in zip(*map(methods, told), strict=True):
            same = first()[nearest] == second()
            totals.setdefault(name, []).append((same[met].mean(), same[raised].mean()))
    for name, shares in totals.items():
        everywhere, raised = np.mean(shares, axis=0)
        yield name, float(everywhere), float(raised)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--data", default=os.environ.get("SCANLOCK_DATA"))
    data = parser.parse_args().data
    if not data:
        parser.error("give --data FOLDER or set SCANLOCK_DATA")
    data = Path(data)
    print(machine(), end="\n\n")
    header = ("cloud", "points", "judged", "told", "method", "precision", "recall", "F1", "ms")
    print_table(header, (row for case in cases(data) for row in _rows(case)))
    if (data / "kitti_drive_0005").is_dir():
        print("\nDrive 0005, scans ten apart: answers that agree with those of the other scan\n")
        print_table(
            ("method", "all points", "0.3 to 2 m above ground"),
            ((name, f"{a:.4f}", f"{b:.4f}") for name, a, b in agreement(data)),
        )


def _rows(case: Case) -> Iterator[tuple[str, ...]]:
    for name, judged, timed in methods(case):
        precision, recall, f1 = scores(case, judged())
        yield (
            case.name,
            str(len(case.points)),
            f"{case.judged.mean():.0%}",
            f"{case.height:.2f} m" if name == "patchworkpp" else "",
            name,
            f"{precision:.3f}",
            f"{recall:.3f}",
            f"{f1:.3f}",
            f"{milliseconds(timed):.1f}",
        )


if __name__ == "__main__":
    main()
