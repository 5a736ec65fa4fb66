"""Scans laid together along trajectories: the maps that a registration earns."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scanlock.arrays import Points
from scanlock.clouds.point_cloud import PointCloud
from scanlock.errors import ScanlockError
from scanlock.evaluation.crispness import VOXEL_SIZE
from scanlock.evaluation.voxel_map import VoxelMap
from scanlock.experiments.experiment import Watch
from scanlock.experiments.series import ScanSeries
from scanlock.geometry.pose import Pose
from scanlock.report.map_figure import DrawnMap
from scanlock.segmentation.segmentation import segment

Tracks = Mapping[str, Sequence[Pose]]
"""first_from_scan of each scan, by what found it."""


@dataclass(frozen=True, slots=True, eq=False)
class LaidMaps:
    """The scans laid together along each trajectory.

    Attributes
    ----------
    points : mapping of str to (n, 3) float32 [m]
        One point in each filled voxel of 0.1 m, in the frame of the first scan.
    drawn : mapping of str to DrawnMap
        What stands above the ground, for the trajectories that are to be drawn.
    """

    points: Mapping[str, NDArray[np.float32]]
    drawn: Mapping[str, DrawnMap]

    def crispness(self, name: str) -> int:
        """Return how many voxels a map fills."""
        return len(self.points[name])


def lay_maps(series: ScanSeries, tracks: Tracks, drawn: Sequence[str], watch: Watch) -> LaidMaps:
    """Return the scans laid together along each trajectory.

    Parameters
    ----------
    series : ScanSeries
        Scans that cannot be read are left out of every map.
    tracks : mapping of str to sequence of Pose
        first_from_scan of each scan.
    drawn : sequence of str
        Which maps are to be drawn too, for which the ground is looked for.
    watch : Watch
    """
    maps = {name: VoxelMap(VOXEL_SIZE) for name in tracks}
    standing: dict[str, list[Points]] = {name: [] for name in drawn}
    for index, name in enumerate(watch(series.names, len(series.names), "laying the maps")):
        try:
            cloud = PointCloud.from_array(series.load(name), f"scan {name}")
        except ScanlockError:
            continue
        points = cloud.points + cloud.origin
        for track, poses in tracks.items():
            maps[track].add(poses[index].apply(points))
        if drawn:
            upright = _thinned(points[~segment(cloud).is_ground[cloud.rows]])
            for track in drawn:
                standing[track].append(tracks[track][index].apply(upright))
    return LaidMaps(
        {name: laid.points for name, laid in maps.items()},
        {
            name: DrawnMap(
                np.concatenate(standing[name]),
                np.stack([pose.translation for pose in tracks[name]]),
                f"{len(maps[name]):,} voxels",
            )
            for name in drawn
        },
    )


def _thinned(points: Points) -> Points:
    kept = VoxelMap(VOXEL_SIZE)
    kept.add(points)
    return kept.points.astype(np.float64)
