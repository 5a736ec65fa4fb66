"""Ground segmentation against references: precision, recall, F1 and CPU time.

    python -m benchmarks.accuracy.ground --data FOLDER

Cases without files are skipped. One protocol for all methods: every point is classified, points
without a reference label are not evaluated, and precision, recall and F1 count points. A method
that does not estimate the sensor height gets it (column "height given").
"""

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

from benchmarks._common.arguments import make_parser
from benchmarks._common.real_scans import kitti_drive
from benchmarks._common.results import Results
from scanlock.clouds.point_cloud import PointCloud
from scanlock.segmentation.ground.finder import GroundDetector, GroundFinder, PublishedGroundFinder
from scanlock.simulation.objects.surface_class import SurfaceClass
from scanlock.simulation.scan import simulate_scan
from scanlock.simulation.sensor_models import SENSORS
from scanlock.simulation.sequence import SCENES

Answer = Callable[[], np.ndarray]

_REPEATS = 7
_RELLIS_GROUND = (1, 3, 10, 23, 31, 33)  # dirt, grass, asphalt, concrete, puddle, mud
_RELLIS_VOID = 0


@dataclass(frozen=True)
class Case:
    """A cloud with its ground mask and the mask of the points that have a reference label."""

    name: str
    points: np.ndarray
    ground: np.ndarray
    evaluated: np.ndarray
    max_range: float | None = None
    known_height: float | None = None

    @property
    def height(self) -> float:
        """Height of the origin above the reference ground around it, or `known_height` [m]."""
        if self.known_height is not None:
            return self.known_height
        ground = self.points[self.ground & self.evaluated]
        ranges = np.hypot(ground[:, 0], ground[:, 1])
        near = ranges <= max(10.0, np.partition(ranges, min(200, len(ranges) - 1))[:200].max())
        return -float(np.median(ground[near, 2]))


def cases(data: Path) -> Iterator[Case]:
    """Yield all cases, real ones first."""
    for reader in (_rellis, _av2, _forest, _airborne):
        yield from reader(data)
    yield from _simulated()


def _rellis(data: Path) -> Iterator[Case]:
    """RELLIS-3D: class ids without void; the Velodyne gets those of the nearest OS1 point."""
    folder = data / "rellis_offroad"
    if not folder.is_dir():
        return
    xyz = np.fromfile(folder / "000104.bin", np.float32).reshape(-1, 4)[:, :3].astype(float)
    label = np.fromfile(folder / "000104.label", np.uint32)
    real = np.abs(xyz).max(axis=1) > 0
    xyz, label = xyz[real], label[real]
    ground, evaluated = np.isin(label, _RELLIS_GROUND), label != _RELLIS_VOID
    yield Case("RELLIS OS1", xyz, ground, evaluated)

    other = np.fromfile(folder / "vel000104.bin", np.float32).reshape(-1, 4)[:, :3].astype(float)
    other = other[np.isfinite(other).all(axis=1) & (np.abs(other).max(axis=1) > 0)]
    # vel2os1.yaml: half a turn about z and a shift, to 0.03 degrees.
    in_os1 = other * [-1, -1, 1] + [-0.25209722874775564, 0.0010963734677, -0.09197253613570998]
    distance, nearest = cKDTree(xyz).query(in_os1)
    yield Case("RELLIS Velodyne", other, ground[nearest], evaluated[nearest] & (distance < 0.2))


def _av2(data: Path) -> Iterator[Case]:
    """Argoverse 2: ground is up to 0.3 m above the data set's terrain raster."""
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
    """Under canopy: the labels mark stems (1) and everything else (0), including leaves.

    Stems are not ground. Other points are ground up to 0.3 m above a local minimum surface.
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
    """Return the 30th percentile of the cell minima in 5 x 5 cells of 1 m; NaN under five cells."""
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
    """Classified airborne tiles, centred; there is no sensor position.

    ASPRS class 2 is ground. Other points count as not ground from 0.5 m above the triangulation
    of class 2, because that class is downsampled and much ground remains in class 1. Water (9) is
    not evaluated.
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
        max_range = float(np.ceil(np.hypot(xyz[:, 0], xyz[:, 1]).max()))
        ground = kind == 2
        terrain = LinearNDInterpolator(xyz[ground, :2], xyz[ground, 2])(xyz[:, :2])
        evaluated = ground | ((xyz[:, 2] - terrain > 0.5) & (kind != 9))
        yield Case(f"airborne {path.stem}", xyz, ground, evaluated, max_range=max_range)


def _simulated() -> Iterator[Case]:
    """Streets and forests with exact labels: kerbs are ground, grass is not evaluated."""
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
                evaluated = scan.labels != SurfaceClass.GRASS
                yield Case(f"{scene_name} {sensor_name} {k}", scan.points, ground, evaluated)


def scores(case: Case, is_ground: np.ndarray) -> tuple[float, float, float]:
    """Return precision, recall and F1 over the evaluated points."""
    predicted, truth = is_ground[case.evaluated], case.ground[case.evaluated]
    hits = float((predicted & truth).sum())
    precision = hits / max(predicted.sum(), 1)
    recall = hits / max(truth.sum(), 1)
    return precision, recall, 2 * precision * recall / max(precision + recall, 1e-12)


def milliseconds(call: Callable[[], object]) -> float:
    """Return the median CPU time of a call, after one call to warm up."""
    call()
    times: list[float] = []
    for _ in range(_REPEATS):
        start = time.process_time()
        call()
        times.append(time.process_time() - start)
    return 1e3 * float(np.median(times))


def methods(case: Case) -> Iterator[tuple[str, Answer, Answer]]:
    """Yield each method by name, with a call to evaluate and a call to time."""
    cloud = PointCloud.from_array(case.points)
    for name, finder in (("scanlock", GroundFinder()), ("das2013", PublishedGroundFinder())):
        if case.max_range is not None:
            finder = replace(finder, grid=replace(finder.grid, max_range=case.max_range))
        call = partial(_found, finder, cloud)
        yield name, call, call
    if find_spec("pypatchworkpp") is not None:
        # Its thresholds adapt along a sequence; a new object evaluates each scan.
        xyz = np.ascontiguousarray(case.points, dtype=np.float32)
        evaluated, timed = _patchwork(case), _patchwork(case)
        yield "patchworkpp", partial(_patched, evaluated, xyz), partial(_patched, timed, xyz)


def _found(finder: GroundDetector, cloud: PointCloud) -> np.ndarray:
    return finder.find(cloud).is_ground


def _patchwork(case: Case) -> object:
    import pypatchworkpp

    parameters = pypatchworkpp.Parameters()
    parameters.sensor_height = case.height
    parameters.enable_RNR = False  # needs intensities of one particular sensor
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
    """Suppress the standard output of compiled code."""
    sys.stdout.flush()
    previous = os.dup(1)
    with open(os.devnull, "w") as nowhere:
        os.dup2(nowhere.fileno(), 1)
        try:
            yield
        finally:
            os.dup2(previous, 1)
            os.close(previous)


def agreement(data: Path, step: int = 10, every: int = 7) -> Iterator[tuple[str, float, float]]:
    """Yield the ratio of points with the same label in two scans, by method.

    Two scans of the drive, `step` scans apart, are aligned by their consensus pose. A point is
    compared with the nearest point of the other scan within 0.2 m. The second ratio is over the
    points between 0.3 and 2 m above the base plane of the default method.
    """
    totals: dict[str, list[tuple[float, float]]] = {}
    for pair in list(kitti_drive(data, step))[::every]:
        clouds = pair.load_target(), pair.load_source()
        both = [Case("", points, np.zeros(0), np.zeros(0), known_height=1.79) for points in clouds]
        distance, nearest = cKDTree(clouds[0]).query(pair.truth.apply(clouds[1]), workers=1)
        matched = distance < 0.2
        plane = GroundFinder().find(PointCloud.from_array(clouds[1])).plane
        above = clouds[1] @ plane[:3] + plane[3]
        raised = matched & (above > 0.3) & (above < 2.0)
        for (name, first, _), (_, second, _) in zip(*map(methods, both), strict=True):
            same = first()[nearest] == second()
            totals.setdefault(name, []).append((same[matched].mean(), same[raised].mean()))
    for name, ratios in totals.items():
        everywhere, raised = np.mean(ratios, axis=0)
        yield name, float(everywhere), float(raised)


def main() -> None:
    arguments = make_parser(__doc__, data=True).parse_args()
    data: Path = arguments.data
    results = Results(arguments.json)
    results.print_machine()
    columns = (
        "cloud", "points", "evaluated", "height given", "method", "precision", "recall", "F1", "ms",
    )  # fmt: skip
    rows = (row for case in cases(data) for row in _rows(case))
    results.add_table(columns, rows, title="ground")
    if (data / "kitti_drive_0005").is_dir():
        results.add_table(
            ("method", "all points", "0.3 to 2 m above ground"),
            ((name, f"{a:.4f}", f"{b:.4f}") for name, a, b in agreement(data)),
            title="agreement",
            note="Drive 0005, scans ten apart: ratio of points with the same label in both scans.",
        )


def _rows(case: Case) -> Iterator[tuple[str, ...]]:
    for name, evaluated, timed in methods(case):
        precision, recall, f1 = scores(case, evaluated())
        yield (
            case.name,
            str(len(case.points)),
            f"{case.evaluated.mean():.0%}",
            f"{case.height:.2f} m" if name == "patchworkpp" else "",
            name,
            f"{precision:.3f}",
            f"{recall:.3f}",
            f"{f1:.3f}",
            f"{milliseconds(timed):.1f}",
        )


if __name__ == "__main__":
    main()
