"""Maps: the scans of a series transformed by the trajectories of several methods."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scanlock.arrays import Points
from scanlock.clouds.point_cloud import PointCloud
from scanlock.errors import ScanlockError
from scanlock.evaluation.crispness import VOXEL_SIZE
from scanlock.evaluation.voxel_map import VoxelMap
from scanlock.experiments.experiment import Progress
from scanlock.experiments.series import ScanSeries
from scanlock.geometry.pose import Pose
from scanlock.report.map_figure import DrawnMap
from scanlock.segmentation.segmentation import segment

Trajectories = Mapping[str, Sequence[Pose]]
"""Poses first_from_scan of all scans, by method."""


@dataclass(frozen=True, slots=True, eq=False)
class MapSet:
    """Maps of one series along several trajectories.

    Attributes
    ----------
    points : mapping of str to (n, 3) float32 [m]
        One point per filled voxel of 0.1 m, in the frame of the first scan.
    drawn : mapping of str to DrawnMap
        Points above the ground, for the maps in the figure.
    """

    points: Mapping[str, NDArray[np.float32]]
    drawn: Mapping[str, DrawnMap]

    @property
    def counts(self) -> dict[str, int]:
        """Number of filled voxels of each map."""
        return {name: len(points) for name, points in self.points.items()}


def build_maps(
    series: ScanSeries, trajectories: Trajectories, drawn: Sequence[str], progress: Progress
) -> MapSet:
    """Return the maps of a series along several trajectories.

    Parameters
    ----------
    series : ScanSeries
        Scans that cannot be read are omitted from every map.
    trajectories : mapping of str to sequence of Pose
        Poses first_from_scan of all scans.
    drawn : sequence of str
        Names of the maps in the figure, which need a segmentation of the ground.
    progress : Progress
        Report of the scans.
    """
    maps = {name: VoxelMap(VOXEL_SIZE) for name in trajectories}
    above_ground: dict[str, list[Points]] = {name: [] for name in drawn}
    for index, name in enumerate(progress(series.names, len(series.names), "building maps")):
        try:
            cloud = PointCloud.from_array(series.load(name), f"scan {name}")
        except ScanlockError:
            continue
        points = cloud.points + cloud.origin
        for trajectory, poses in trajectories.items():
            maps[trajectory].add(poses[index].apply(points))
        if drawn:
            obstacles = _downsampled(points[~segment(cloud).is_ground[cloud.rows]])
            for trajectory in drawn:
                pose = trajectories[trajectory][index]
                above_ground[trajectory].append(pose.apply(obstacles))
    return MapSet(
        {name: one.points for name, one in maps.items()},
        {
            name: DrawnMap(
                np.concatenate(above_ground[name]),
                np.stack([pose.translation for pose in trajectories[name]]),
                f"{len(maps[name]):,} voxels",
            )
            for name in drawn
        },
    )


def _downsampled(points: Points) -> Points:
    voxels = VoxelMap(VOXEL_SIZE)
    voxels.add(points)
    return voxels.points.astype(np.float64)
