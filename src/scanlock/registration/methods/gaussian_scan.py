"""Coarse-to-fine schedules of Gaussians: prepared scans and usable scales."""

from collections.abc import Sequence
from dataclasses import dataclass

from scanlock.arrays import Points, frozen
from scanlock.errors import InvalidInput, require_positive
from scanlock.models.gaussians import Gaussians
from scanlock.models.voxel_gaussians import VoxelGaussians
from scanlock.registration.methods.protocol import InsufficientData
from scanlock.segmentation.cluster_gaussians import MIN_GAUSSIANS

MIN_COVERAGE = 0.6
"""Minimum ratio of a scan's points that belong to the Gaussians of a scale.

The ratio for cells of 1 m with six points each is above 0.9 in scans of 60,000 points and more, and
0.7 in one of 21,000. Below one half only near or upright surfaces remain, which biases the pose.
"""


@dataclass(frozen=True, slots=True, eq=False)
class GaussianScan:
    """A scan prepared as Gaussians at several scales. Build with `gaussian_scan`.

    Attributes
    ----------
    points : (n, 3) [m]
        Downsampled points.
    gaussians : tuple of Gaussians
        One set for each scale, coarse to fine.
    coverage : tuple of float
        Ratio of the scan's points that belong to the Gaussians of each scale.
    voxels : tuple of VoxelGaussians
        The cells of the Gaussians at each scale; empty if the Gaussians are not those of a grid.
    """

    points: Points
    gaussians: tuple[Gaussians, ...]
    coverage: tuple[float, ...]
    voxels: tuple[VoxelGaussians, ...]

    def __post_init__(self) -> None:
        frozen(self.points)


def gaussian_scan(
    points: Points,
    gaussians: Sequence[Gaussians],
    count: int,
    voxels: Sequence[VoxelGaussians] = (),
) -> GaussianScan:
    """Return the scan of Gaussians that were estimated from `count` points.

    Raises
    ------
    InsufficientData
        No scale has enough Gaussians.
    """
    most = max(len(one) for one in gaussians)
    if most < MIN_GAUSSIANS:
        raise InsufficientData(f"has {most} Gaussians; {MIN_GAUSSIANS} are needed")
    coverage = tuple(float(one.counts.sum()) / max(1, count) for one in gaussians)
    return GaussianScan(points, tuple(gaussians), coverage, tuple(voxels))


def dense_scales(*scans: GaussianScan) -> list[int]:
    """Return the scales at which all scans have enough Gaussians and coverage.

    If there is none, return the scale with the largest number of Gaussians.
    """
    counts = _minima([[len(one) for one in scan.gaussians] for scan in scans])
    coverage = _minima([scan.coverage for scan in scans])
    dense = [
        scale
        for scale, (count, ratio) in enumerate(zip(counts, coverage, strict=True))
        if count >= MIN_GAUSSIANS and ratio >= MIN_COVERAGE
    ]
    return dense or [max(range(len(counts)), key=lambda scale: counts[scale])]


def require_coarse_to_fine(name: str, sizes: Sequence[float]) -> None:
    """Raise `InvalidInput` unless there are sizes [m], all positive and none above the previous."""
    if not sizes or list(sizes) != sorted(sizes, reverse=True):
        raise InvalidInput(f"{name} must be descending and not empty, got {sizes}")
    for size in sizes:
        require_positive(name, size, unit="m")


def _minima(rows: Sequence[Sequence[float]]) -> list[float]:
    return [min(column) for column in zip(*rows, strict=True)]
