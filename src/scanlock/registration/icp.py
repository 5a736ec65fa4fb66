"""Iterative closest points: the algorithm of Madhavan and Messina 2003, section 2.1."""

import math
from dataclasses import dataclass, field

import numpy as np

from scanlock.clouds.neighbours import Search, closest_points
from scanlock.clouds.point_cloud import PointCloud
from scanlock.clouds.point_tree import PointTree
from scanlock.clouds.voxel_grid import voxel_means
from scanlock.errors import require_at_least, require_count, require_positive
from scanlock.geometry.pose import Pose
from scanlock.models.sensor_noise import SensorNoise
from scanlock.models.surfaces import LEAST_NEIGHBOURS, surface_normals
from scanlock.objectives.quadratic import Quadratic
from scanlock.objectives.restraint import FREE, Restraint
from scanlock.registration.pair_fit import PairFit
from scanlock.registration.pairing import LEAST_POINTS, Pairing, PointScan, typical_spacing
from scanlock.registration.stages import StageClock
from scanlock.solvers.solution import Iteration, Solution
from scanlock.solvers.stopping import StopReason


@dataclass(frozen=True, kw_only=True, slots=True)
class IcpStopping:
    """The three ways to stop of the paper: near enough, no more change, or too long."""

    mean_distance: float | None = None
    """Stop when the pairs are this close on average [m]; None never asks."""

    change: float = 0.0
    """Stop when translation and rotation change by no more than this share of themselves, 0.01
    in Zhang 1994. Shares of a motion near zero mean nothing, so `step` counts besides."""

    step: float = 1e-6
    """Stop when the pose changes by less than this [m], rotations counted at the lever."""

    iterations: int = 100
    """Pairings allowed."""

    def __post_init__(self) -> None:
        if self.mean_distance is not None:
            require_positive("mean_distance", self.mean_distance, unit="m")
        require_at_least("change", self.change, 0.0)
        require_positive("step", self.step, unit="m")
        require_count("iterations", self.iterations)

    def reason(self, history: list[Iteration]) -> tuple[StopReason | None, str]:
        """Return why to stop after the last of these iterations, and a note; None to go on."""
        last = history[-1]
        if self.mean_distance is not None and last.mean_distance <= self.mean_distance:
            return StopReason.STEP_SMALL, (
                f"stopped at a mean pair distance of {last.mean_distance:.4g} m, at most "
                f"{self.mean_distance:g} m"
            )
        if len(history) > 1:
            if last.step_norm < self.step:
                return StopReason.STEP_SMALL, "stopped because the pose changed no more"
            metres, radians = last.pose.distance(history[-2].pose)
            distance, angle = last.pose.distance(Pose.identity())
            if metres <= self.change * distance and radians <= self.change * angle:
                return StopReason.STEP_SMALL, (
                    f"stopped because translation and rotation changed by {self.change:g} of "
                    "themselves at most"
                )
        if len(history) >= self.iterations:
            return StopReason.ITERATION_LIMIT, f"stopped after {self.iterations} iterations"
        return None, ""


@dataclass(frozen=True, kw_only=True, slots=True)
class Icp:
    """Settings of ICP; `prepare` each scan once, `align` as many pairs as wanted."""

    search: Search = "k-d tree"
    """How closest points are found: a k-d tree, or the paper's Delaunay tessellation."""

    pairing: Pairing = field(default_factory=Pairing)
    """Which pairs count, and how much."""

    fit: PairFit = field(default_factory=PairFit)
    """How pairs become a motion."""

    noise: SensorNoise | None = None
    """Noise of both sensors, by which pairs are weighed; None weighs all alike."""

    spacing: float | None = 0.5
    """Either scan is thinned to the mean of its points in each voxel of this side [m]; None takes
    all points, as in the paper."""

    neighbours: int = 10
    """Nearest points, itself included, that make the surface about a point."""

    stopping: IcpStopping = field(default_factory=IcpStopping)
    """When to stop."""

    def __post_init__(self) -> None:
        if self.spacing is not None:
            require_positive("spacing", self.spacing, unit="m")
        require_count("neighbours", self.neighbours, LEAST_NEIGHBOURS)

    def prepare(self, cloud: PointCloud) -> PointScan:
        """Return what the method keeps of a scan."""
        clock = StageClock()
        with clock.stage("thin"):
            points = cloud.points
            if self.spacing is not None:
                points = voxel_means(points, self.spacing)
        with clock.stage("search"):
            tree = PointTree.from_points(points)
            closest = closest_points(tree, self.search)
            spacing = typical_spacing(tree)
        normals, covariances = np.zeros((0, 3)), np.zeros((0, 6))
        with clock.stage("surface"):
            if self.fit.residual == "point-to-plane" or self.pairing.orientation is not None:
                normals = surface_normals(tree, self.neighbours)
            if self.noise is not None:
                covariances = self.noise.covariances(tree.points)
        notes = [f"{len(tree)} points to pair, {spacing:.3g} m apart"]
        if self.noise is not None and cloud.origin.any():
            notes.append("sensor noise taken about the origin, where the sensor may not be")
        return PointScan(cloud, closest, spacing, normals, covariances, tuple(notes), clock.seconds)

    def align(
        self, target: PointScan, source: PointScan, start: Pose, restraint: Restraint = FREE
    ) -> Solution:
        """Return the pose that carries the source onto the target, from a start.

        The history has one entry for each pairing: the pose of that pairing, the objective
        there, and how far apart the pairs are that count. A start where fewer than 10 points
        meet is returned untouched, with NO_SUPPORT.
        """
        pose, limit, moved, history = start, math.inf, 0.0, list[Iteration]()
        notes = [self.pairing.gate.note(target.spacing)]
        while True:
            pairs = self.pairing.pair(target, source, pose, limit, self.fit.residual)
            if len(pairs) < LEAST_POINTS:
                history.append(
                    Iteration(0.0, 0.0, moved, False, pose, pairs.mean_distance, len(pairs))
                )
                return Solution(start, _NOTHING, StopReason.NO_SUPPORT, tuple(history))
            limit = pairs.limit
            objective = self.fit.objective(target, source, pairs, pose)
            quadratic = restraint.on(objective).linearise(pose)
            slope = self._scaled_norm(quadratic)
            history.append(
                Iteration(
                    quadratic.value, slope, moved, True, pose, pairs.mean_distance, len(pairs)
                )
            )
            reason, note = self.stopping.reason(history)
            notes.append(note)
            if reason is not None:
                notes.append(
                    f"{len(pairs)} pairs, {len(pairs) / len(source.points):.0%} of the source"
                )
                return Solution(
                    pose,
                    quadratic,
                    reason,
                    tuple(history),
                    tuple(dict.fromkeys(filter(None, notes))),
                )
            before = pose
            pose, note = self.fit.moved(objective, quadratic, pose, restraint)
            notes.append(note)
            metres, radians = pose.distance(before)
            moved = math.hypot(metres, self.fit.lever * radians)

    def _scaled_norm(self, quadratic: Quadratic) -> float:
        gradient = quadratic.gradient
        return math.hypot(*gradient[:3], *(gradient[3:] / self.fit.lever))


_NOTHING = Quadratic(0.0, np.zeros(6), np.zeros((6, 6)))
