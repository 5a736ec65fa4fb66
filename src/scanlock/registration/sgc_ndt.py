"""Segmented greedy cluster NDT: Algorithm 1 of Das et al. 2013, and its D2D sibling."""

from dataclasses import dataclass, field
from typing import Literal

from scanlock.clouds.point_cloud import PointCloud
from scanlock.geometry.pose import Pose
from scanlock.objectives.gaussian_scores import GaussiansToGaussians, PointsToGaussians
from scanlock.objectives.quadratic import Objective
from scanlock.registration.coarse_to_fine import CoarseToFine
from scanlock.registration.landmarks import LandmarkFinder, Landmarks
from scanlock.solvers.newton import Solution


@dataclass(frozen=True, kw_only=True, slots=True)
class SgcNdt:
    """Settings of SGC-NDT; `prepare` each scan once, `align` as many pairs as wanted."""

    score: Literal["d2d", "p2d"] = "d2d"
    """Gaussians of the source, or its obstacle points, against Gaussians of the target."""

    landmarks: LandmarkFinder = field(default_factory=LandmarkFinder)
    """Lines 1 to 5: ground removed, the rest clustered, clusters as Gaussians."""

    schedule: CoarseToFine = field(default_factory=CoarseToFine)
    """Lines 6 to 21, at each blur in turn; a single blur of 0 is the paper's own."""

    def prepare(self, cloud: PointCloud) -> Landmarks:
        """Return what the method keeps of a scan."""
        return self.landmarks.find(cloud)

    def align(self, target: Landmarks, source: Landmarks, start: Pose) -> Solution:
        """Return the pose that carries the source onto the target, from a start."""

        def objective_at(blur: float) -> Objective:
            if self.score == "p2d":
                # Only one side can be blurred, so it takes the blur of both.
                return PointsToGaussians(
                    target=target.gaussians.widened(blur * 2**0.5), points=source.obstacles
                )
            return GaussiansToGaussians(
                target=target.gaussians.widened(blur), source=source.gaussians.widened(blur)
            )

        return self.schedule.minimise(objective_at, start)
