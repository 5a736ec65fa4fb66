"""Preparation of a scan for the NDT methods on a grid: Gaussians of the cells at several sizes."""

from collections.abc import Sequence

from scanlock.arrays import read_only
from scanlock.clouds.point_cloud import PointCloud
from scanlock.clouds.voxel_grid import voxel_means
from scanlock.models.voxel_gaussians import VoxelGrid
from scanlock.registration.methods.gaussian_scan import GaussianScan, gaussian_scan
from scanlock.registration.methods.protocol import PreparationLog


def prepare_voxels(
    cloud: PointCloud,
    grid: VoxelGrid,
    cell_sizes: Sequence[float],
    log: PreparationLog | None,
    voxel_size: float = 0.0,
) -> GaussianScan:
    """Return the Gaussians of a cloud at each cell size, and its downsampled points.

    Parameters
    ----------
    cloud : PointCloud
    grid : VoxelGrid
        Estimates the Gaussians.
    cell_sizes : sequence of float [m]
    log : PreparationLog or None
    voxel_size : float [m]
        Voxel size of the downsampling; 0 keeps all points.

    Raises
    ------
    InsufficientData
        No cell size has enough Gaussians.
    """
    log = log or PreparationLog()
    with log.stage("gaussians"):
        # Zeros, where nothing returned, coincide in both scans and would hold the pose there.
        points = cloud.measured_points
        voxels = [grid.gaussians(points, size) for size in cell_sizes]
    with log.stage("downsample"):
        sampled = voxel_means(points, voxel_size) if voxel_size > 0.0 else points
    gaussians = [one.gaussians for one in voxels]
    scan = gaussian_scan(read_only(sampled), gaussians, len(points), voxels)
    counts = ", ".join(f"{len(one)} Gaussians of {cloud.scale * one.size:g} m" for one in voxels)
    log.note(f"{counts}, of {len(sampled)} points")
    return scan
