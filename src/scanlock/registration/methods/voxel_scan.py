"""What the methods on voxels keep of a scan: its points, and their Gaussians at each width."""

from collections.abc import Sequence
from dataclasses import dataclass

from scanlock.arrays import Points, frozen, read_only
from scanlock.clouds.point_cloud import PointCloud
from scanlock.clouds.voxel_grid import voxel_means
from scanlock.errors import InvalidInput, require_positive
from scanlock.kernels.points.rows import chosen_points
from scanlock.models.gaussians import Gaussians
from scanlock.models.voxel_gaussians import VoxelGaussians, VoxelGrid
from scanlock.registration.methods.protocol import PreparationLog
from scanlock.registration.methods.scales import require_enough, shares_of


@dataclass(frozen=True, slots=True, eq=False)
class VoxelScan:
    """A scan ready to be registered, as target or as source.

    Attributes
    ----------
    points : (n, 3) [m]
        Its thinned points.
    voxels : tuple of VoxelGaussians
        One set for each width, coarsest first.
    shares : tuple of float
        Share of all points that each set holds.
    """

    points: Points
    voxels: tuple[VoxelGaussians, ...]
    shares: tuple[float, ...]

    def __post_init__(self) -> None:
        frozen(self.points)

    @property
    def gaussians(self) -> tuple[Gaussians, ...]:
        """Those of the voxels."""
        return tuple(one.gaussians for one in self.voxels)


def prepare_voxels(
    cloud: PointCloud,
    grid: VoxelGrid,
    widths: Sequence[float],
    log: PreparationLog | None,
    spacing: float = 0.0,
) -> VoxelScan:
    """Return the Gaussians of a cloud at each width [m], and its points thinned to a spacing.

    A spacing [m] of 0 keeps all points.
    """
    log = log or PreparationLog()
    with log.stage("gaussians"):
        points = measured_points(cloud)
        voxels = tuple(grid.gaussians(points, width) for width in widths)
    with log.stage("thin"):
        thinned = voxel_means(points, spacing) if spacing > 0.0 else points
    shares = shares_of([one.gaussians for one in voxels], len(points))
    scan = VoxelScan(read_only(thinned), voxels, shares)
    require_enough(scan, "cells with enough points")
    found = ", ".join(f"{len(one)} Gaussians of {one.size:g} m" for one in voxels)
    log.note(f"{found}, of {len(thinned)} points")
    return scan


def require_widths(widths: Sequence[float]) -> None:
    """Raise `InvalidInput` unless there is a width, all are positive, and none grows."""
    if not widths or list(widths) != sorted(widths, reverse=True):
        raise InvalidInput(f"widths must not grow from scale to scale, got {widths}")
    for width in widths:
        require_positive("widths", width, unit="m")


def measured_points(cloud: PointCloud) -> Points:
    """Return the points of a cloud without those at exactly zero of a sensor's frame.

    A heap of them lies at the sensor in either scan, and would hold the scans where they are.
    """
    if cloud.is_measured.all():
        return cloud.points
    return read_only(chosen_points(cloud.points, cloud.is_measured))
