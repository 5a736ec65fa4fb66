"""From any starting pose, or none, to millimetres: hypotheses, descents, fine stage, choice."""

import math
from dataclasses import dataclass, field, replace

from scanlock.clouds.point_cloud import PointCloud
from scanlock.errors import require_at_least, require_fraction
from scanlock.geometry.pose import Pose
from scanlock.optimisation.objectives.constraints import UNCONSTRAINED, Constraints
from scanlock.optimisation.solvers.criteria import StopReason
from scanlock.optimisation.solvers.solution import Iteration, Solution
from scanlock.registration.methods.auto_scan import AutoScan
from scanlock.registration.methods.fine_ndt import FineNdt
from scanlock.registration.methods.multi_start import MultiStart, RefinedHypothesis
from scanlock.registration.methods.protocol import InsufficientData, Method, PreparationLog
from scanlock.registration.methods.sgc_ndt import SgcNdt
from scanlock.registration.search.bev_correlation import BevSearch
from scanlock.registration.search.bev_grid import level_pose
from scanlock.registration.search.cluster_matching import ClusterMatcher
from scanlock.registration.search.hypothesis import Hypothesis, distinct
from scanlock.registration.verification.agreement import candidate_at, free_space_violation
from scanlock.registration.verification.candidate import INITIAL, Candidate, plausibility
from scanlock.registration.verification.features import VerificationFeatures, features_from_clusters
from scanlock.registration.verification.range_image import RangeImager
from scanlock.segmentation.ground.result import GroundStatus

_START_APART = 2.0
"""A start may be this many times as far from where it leads as two ends of one place: 1 m is what
the fine stage forgives."""

_MOST_IN_DOUBT = 8
"""Hypotheses of the deeper search that are followed. The violation of a right one of simulated
forests was a tenth of that of the next, among sixty."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Auto(Method[AutoScan]):
    """Settings of the default method; `prepare` each scan once, `align` any pair."""

    search: BevSearch | None = field(default_factory=BevSearch)
    """Proposes poses from the scans themselves; None leaves it out."""

    fallback_search: BevSearch | None = field(
        default_factory=lambda: BevSearch(
            free_cell_weight=0.4, max_hypotheses=60, min_score_ratio=0.3
        )
    )
    """Proposes more poses where those leave doubt; free space sorts out the few to follow. None
    leaves it out. Its viewer is that of `search`."""

    matcher: ClusterMatcher | None = field(default_factory=ClusterMatcher)
    """Proposes poses from matched clusters, whatever the tilt, where a scan has no ground or doubt
    is left; None leaves it out."""

    initial_method: SgcNdt = field(default_factory=SgcNdt)
    """Descends from an initial pose by its full schedule, which forgives 10 m and 60 degrees."""

    multi_start: MultiStart = field(default_factory=MultiStart)
    """Descends from the hypotheses."""

    range_imager: RangeImager | None = field(default_factory=RangeImager)
    """Says which poses put things where the other scan looked through; None leaves it out."""

    fine: FineNdt | None = field(default_factory=FineNdt)
    """Ends what the descents have left; None leaves it out."""

    initial_pose_preference: float = 1.2
    """An initial pose is left for another only if the agreement there is this many times as
    good: who gives one usually knows."""

    fallback_threshold: float = 0.08
    """With an agreement below this at the end, or much that stands where the other scan looked
    through, what else can be tried is tried."""

    def __post_init__(self) -> None:
        require_at_least("initial_pose_preference", self.initial_pose_preference, 1.0)
        require_fraction("fallback_threshold", self.fallback_threshold)

    @property
    def covariance_factor(self) -> float:
        """Measured on simulated pairs; see `benchmarks/uncertainty`."""
        return self.initial_method.covariance_factor if self.fine is None else 0.89

    def prepare(self, cloud: PointCloud, log: PreparationLog | None = None) -> AutoScan:
        """Return what the method keeps of a scan."""
        log = log or PreparationLog()
        finder = self.initial_method.extractor
        with log.stage("ground"):
            ground = finder.segmenter.ground.find(cloud)
        basin = [scale.max_radius for scale in self.initial_method.schedule.scales]
        near = [scale.max_radius for scale in self.multi_start.scales]
        radii = sorted({*basin, *near}, reverse=True)
        found = finder.find_above(cloud, ground, radii, log.clock)
        parts = dict(zip(radii, found.gaussians, strict=True))
        with log.stage("view"):
            view = None if self.search is None else self.search.grid(cloud, ground)
            level = None if ground.status is GroundStatus.NONE else level_pose(cloud, ground)
        with log.stage("evidence"):
            features = features_from_clusters(found, self.range_imager)
        with log.stage("cells"):
            fine = None if self.fine is None else self.fine.prepare(cloud)
        scan = AutoScan(
            replace(found, gaussians=tuple(parts[radius] for radius in basin)),
            tuple(parts[radius] for radius in near),
            view,
            level,
            features,
            fine,
        )
        if scan.insufficient:
            raise InsufficientData(scan.insufficient)
        for note in found.notes:
            log.note(note)
        if fine is not None:
            log.note(f"{len(fine.gaussians)} cells of {fine.width:g} m")
        log.features = features
        return scan

    def align(
        self,
        target: AutoScan,
        source: AutoScan,
        start: Pose | None = None,
        constraints: Constraints = UNCONSTRAINED,
    ) -> Solution:
        """Return the pose that carries the source onto the target, and what else there was.

        Parameters
        ----------
        target, source : AutoScan
        start : Pose, optional
            One more hypothesis, and the value of locked directions; the identity by default.
        restraint : Restraint
        """
        history: tuple[Iteration, ...] = ()
        rivals: list[tuple[Candidate, Solution]] = []
        for ends in (self._first_ends, self._further_ends):
            ended, steps = ends(target, source, start, constraints)
            history += steps + tuple(step for one in ended for step in one.solution.history)
            features = target.features, source.features
            rivals += [(judged(*features, one), one.solution) for one in ended]
            count = len(source.gaussians[-1])
            rivals.sort(key=lambda rival: self._standing(*rival, constraints, count), reverse=True)
            poses = [candidate.target_from_source for candidate, _ in rivals]
            rivals = [rivals[row] for row in distinct(poses, *self.multi_start.min_separation)]
            best = rivals[0][0] if rivals else None
            if best is not None and best.is_plausible and best.agreement >= self.fallback_threshold:
                break
        return replace(
            rivals[0][1],
            history=history,
            candidates=tuple(candidate for candidate, _ in rivals),
            runner_up_ratio=self._rivalry(rivals, constraints, len(source.gaussians[-1])),
        )

    def _rivalry(
        self, ended: list[tuple[Candidate, Solution]], constraints: Constraints, count: int
    ) -> float:
        """Return how well the second stands, as a share of the first.

        A prior may decide between poses that agree as well. An initial pose is but a hypothesis,
        which may itself lie at a twin of the right one.
        """
        if len(ended) < 2:
            return 0.0
        (_, first), (_, second) = (self._standing(*one, constraints, count) for one in ended[:2])
        return max(0.0, second / first) if first > 0.0 else math.nan

    def _first_ends(
        self, target: AutoScan, source: AutoScan, initial: Pose | None, constraints: Constraints
    ) -> tuple[list[RefinedHypothesis], tuple[Iteration, ...]]:
        """Return where the search and an initial pose lead."""
        ended, history = self._descended(
            target, source, self._hypotheses(target, source, constraints), initial, constraints
        )
        if initial is not None:
            ended += self._ends_of(target, source, initial, INITIAL, constraints, ended)
        return ended, history

    def _further_ends(
        self, target: AutoScan, source: AutoScan, initial: Pose | None, constraints: Constraints
    ) -> tuple[list[RefinedHypothesis], tuple[Iteration, ...]]:
        """Return where everything else leads, for scans that the first ends leave in doubt."""
        proposed: list[Hypothesis] = []
        if (
            self.fallback_search is not None
            and target.bev_grid is not None
            and source.bev_grid is not None
        ):
            proposed = self.fallback_search.hypotheses(target.bev_grid, source.bev_grid)
        features = target.features, source.features
        proposed.sort(
            key=lambda one: one.weight * plausibility(free_space_violation(*features, one.pose)),
            reverse=True,
        )
        proposed = proposed[:_MOST_IN_DOUBT]
        if target.has_ground and source.has_ground:
            # What was taken for ground may be a wall: once as it was levelled, once freely.
            proposed += self._matched(target, source)
            proposed += self._matched(target, source, is_free=True)
        ended, history = self._descended(target, source, proposed, initial, constraints)
        if initial is None:
            start = Pose.identity()
            ended += self._ends_of(target, source, start, "identity", constraints, ended)
        return ended, history

    def _descended(
        self,
        target: AutoScan,
        source: AutoScan,
        hypotheses: list[Hypothesis],
        initial: Pose | None,
        constraints: Constraints,
    ) -> tuple[list[RefinedHypothesis], tuple[Iteration, ...]]:
        """Return where hypotheses lead through the descents and the fine stage."""
        if not (target.has_gaussians and source.has_gaussians):
            return [], ()
        start = initial or Pose.identity()
        ended, history = self.multi_start.refine(
            target.gaussians,
            source.gaussians,
            [replace(one, pose=constraints.project(one.pose, start)) for one in hypotheses],
            constraints,
            lambda pose: plausibility(free_space_violation(target.features, source.features, pose)),
        )
        return [self._refined(target, source, one, constraints) for one in ended], history

    def _ends_of(
        self,
        target: AutoScan,
        source: AutoScan,
        start: Pose,
        proposed_by: str,
        constraints: Constraints,
        known: list[RefinedHypothesis],
    ) -> list[RefinedHypothesis]:
        """Return where a start leads: through its basin, and straight into the fine stage.

        A start close by must not be lost on the way through coarser scales. Where its basin leads
        to a place that is known, that is its end; the only one if the start lies close to that.
        """
        ended: list[RefinedHypothesis] = []
        if target.has_gaussians and source.has_gaussians:
            solution = self.initial_method.align(
                target.clusters, source.clusters, start, constraints
            )
            met = self._known_at(solution.pose, known)
            if met is None:
                ended.append(
                    self._refined(
                        target, source, RefinedHypothesis(proposed_by, solution), constraints
                    )
                )
            else:
                ended.append(RefinedHypothesis(proposed_by, replace(met, history=solution.history)))
                if self._known_at(start, ended, _START_APART) is not None:
                    return ended
        if self.fine is not None and target.fine is not None and source.fine is not None:
            solution = self.fine.align(target.fine, source.fine, start, constraints)
            ended.append(RefinedHypothesis(proposed_by, solution))
        return ended

    def _known_at(
        self, pose: Pose, known: list[RefinedHypothesis], times: float = 1.0
    ) -> Solution | None:
        """Return the first solution that is not so many times `apart`, None without one."""
        metres, radians = (times * limit for limit in self.multi_start.min_separation)
        for one in known:
            if one.solution.pose.is_close(pose, translation=metres, rotation=radians):
                return one.solution
        return None

    def _hypotheses(
        self, target: AutoScan, source: AutoScan, constraints: Constraints
    ) -> list[Hypothesis]:
        found: list[Hypothesis] = []
        if constraints.prior is not None:
            found.append(Hypothesis(constraints.prior.pose, 1.0, "prior"))
        if self.search is not None and target.bev_grid is not None and source.bev_grid is not None:
            found += self.search.hypotheses(target.bev_grid, source.bev_grid)
        if not (target.has_ground and source.has_ground):
            found += self._matched(target, source)
        return found

    def _matched(
        self, target: AutoScan, source: AutoScan, is_free: bool = False
    ) -> list[Hypothesis]:
        if self.matcher is None:
            return []
        # Not kept with a scan: few pairs leave a doubt that needs them.
        features = [
            self.matcher.describe(one.gaussians[0], None if is_free else one.level)
            for one in (target, source)
        ]
        return self.matcher.hypotheses(*features)

    def _refined(
        self,
        target: AutoScan,
        source: AutoScan,
        descent: RefinedHypothesis,
        constraints: Constraints,
    ) -> RefinedHypothesis:
        if self.fine is None or target.fine is None or source.fine is None:
            return descent
        pose = descent.solution.pose
        solution = self.fine.align(target.fine, source.fine, pose, constraints)
        return (
            descent
            if solution.reason is StopReason.EMPTY_OBJECTIVE
            else replace(descent, solution=solution)
        )

    def _standing(
        self, candidate: Candidate, solution: Solution, constraints: Constraints, count: int
    ) -> tuple[bool, float]:
        """Return how good a candidate is, of a source of `count` parts; the best is chosen."""
        standing = candidate.agreement
        if candidate.proposed_by == INITIAL:
            standing *= self.initial_pose_preference
        if constraints.prior is not None:
            # As in the objectives, the prior is one observation beside those of the parts.
            belief = constraints.prior.linearise(candidate.target_from_source).value
            standing -= belief / max(1, count)
        return solution.reason is not StopReason.EMPTY_OBJECTIVE, standing


def judged(
    target: VerificationFeatures, source: VerificationFeatures, descent: RefinedHypothesis
) -> Candidate:
    """Return the candidate that a descent ended with."""
    return candidate_at(target, source, descent.solution.pose, descent.proposed_by)
