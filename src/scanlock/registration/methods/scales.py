"""Which scales of a schedule the scans are dense enough for."""

from collections.abc import Sequence
from typing import Protocol

from scanlock.models.gaussians import Gaussians
from scanlock.registration.methods.protocol import InsufficientData
from scanlock.segmentation.cluster_gaussians import MIN_GAUSSIANS

MIN_COVERAGE = 0.6
"""Share of a scan's points that the Gaussians of a scale must hold.

Scans of 60,000 points and more have over 0.9 of them in cells of 1 m with six points each, one of
21,000 has 0.7; below a half only what is near or upright is left, and the pose follows that.
"""


class Scaled(Protocol):
    """A scan as Gaussians at several scales."""

    @property
    def gaussians(self) -> tuple[Gaussians, ...]:
        """One set for each scale, coarsest first."""
        ...

    @property
    def shares(self) -> tuple[float, ...]:
        """Share of the scan's points that each set holds."""
        ...


def dense_scales(*scans: Scaled) -> list[int]:
    """Return the scales at which every scan has Gaussians enough; at least the one with most."""
    counts = _least([[len(one) for one in scan.gaussians] for scan in scans])
    shares = _least([scan.shares for scan in scans])
    dense = [
        scale
        for scale, (count, share) in enumerate(zip(counts, shares, strict=True))
        if count >= MIN_GAUSSIANS and share >= MIN_COVERAGE
    ]
    return dense or [max(range(len(counts)), key=lambda scale: counts[scale])]


def require_enough(scan: Scaled, parts: str) -> None:
    """Raise `InsufficientData` where no scale has enough Gaussians."""
    most = max(len(one) for one in scan.gaussians)
    if most < MIN_GAUSSIANS:
        raise InsufficientData(f"has {most} {parts}; {MIN_GAUSSIANS} are needed")


def shares_of(gaussians: Sequence[Gaussians], count: int) -> tuple[float, ...]:
    """Return the share of `count` points that each set of Gaussians holds."""
    return tuple(float(one.counts.sum()) / max(1, count) for one in gaussians)


def _least(rows: Sequence[Sequence[float]]) -> list[float]:
    return [min(column) for column in zip(*rows, strict=True)]
