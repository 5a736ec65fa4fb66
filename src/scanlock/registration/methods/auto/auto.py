"""The default method: global search, refinement of the hypotheses, choice by score.

1. Hypotheses: BEV correlation, cluster matching, prior.
2. Refinement: multi-start D2D over clusters, then fine NDT over small cells. An initial pose is
   refined by SGC-NDT over its full schedule, then by fine NDT, and by fine NDT alone.
3. Score of each refined pose: overlap, correlation, free space, the prior, and a given start.
4. Fallback, if the best score is low: a wider search, refinement and scores as before.
5. Choice: the pose with the highest score; among poses with similar scores the most probable one
   by the verification. It is refined once more if the clouds are sparse.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from scanlock.clouds.point_cloud import PointCloud
from scanlock.errors import require_at_least, require_fraction
from scanlock.geometry.pose import Pose
from scanlock.optimisation.objectives.constraints import UNCONSTRAINED, Constraints
from scanlock.optimisation.solvers.criteria import StopReason
from scanlock.optimisation.solvers.solution import Iteration, Solution
from scanlock.registration.methods.auto.data import AutoData, AutoPair
from scanlock.registration.methods.auto.judgement import judged_poses
from scanlock.registration.methods.auto.multi_start import MultiStart, RefinedHypothesis
from scanlock.registration.methods.auto.ranking import (
    ScoredPose,
    ranked_poses,
    runner_up_ratio,
    score_pose,
)
from scanlock.registration.methods.auto.similar_poses import similar_hypotheses
from scanlock.registration.methods.fine_ndt import FineNdt
from scanlock.registration.methods.protocol import InsufficientData, Method, PreparationLog
from scanlock.registration.methods.sgc_ndt import SgcNdt
from scanlock.registration.methods.sparse_refinement import SparseRefinement
from scanlock.registration.search.bev_correlation import BevSearch
from scanlock.registration.search.bev_grid import level_pose
from scanlock.registration.search.cluster_matching import ClusterMatcher
from scanlock.registration.search.hypothesis import Hypothesis
from scanlock.registration.verification.candidate import INITIAL
from scanlock.registration.verification.features import features_from_clusters
from scanlock.registration.verification.range_image import RangeImager
from scanlock.segmentation.ground.result import GroundStatus

_MAX_START_DISTANCE = 2.0
"""Maximum distance from a start to its refined pose, in units of `MultiStart.min_separation`, at
which fine NDT from the start is skipped. It would end at the same pose: 1 m is in its basin."""

_MAX_FALLBACK_HYPOTHESES = 8
"""Number of BEV hypotheses that the fallback refines. In simulated forests the free-space violation
of the correct one of sixty was a tenth of the next."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Auto(Method[AutoData]):
    """Settings of the default method; `prepare` each scan once, `align` any pair."""

    search: BevSearch | None = field(default_factory=BevSearch)
    """BEV correlation; None disables it."""

    fallback_search: BevSearch | None = field(
        default_factory=lambda: BevSearch(
            free_cell_weight=0.4, max_hypotheses=60, min_score_ratio=0.3
        )
    )
    """BEV correlation of the fallback, on the grids of `search`; None disables it. Free-space
    violations select the hypotheses to refine."""

    matcher: ClusterMatcher | None = field(default_factory=ClusterMatcher)
    """Cluster matching for any roll and pitch, used without a ground and in the fallback; None
    disables it."""

    initial_method: SgcNdt = field(default_factory=SgcNdt)
    """Refinement of an initial pose; its basin is 10 m and 60 degrees."""

    multi_start: MultiStart = field(default_factory=MultiStart)
    """Refinement of the hypotheses."""

    range_imager: RangeImager | None = field(default_factory=RangeImager)
    """Range images for free-space violations; None disables them."""

    fine: FineNdt | None = field(default_factory=FineNdt)
    """Fine NDT from each refined pose; None disables it."""

    sparse_refinement: SparseRefinement | None = field(default_factory=SparseRefinement)
    """Refinement of the chosen pose of sparse clouds; None disables it."""

    initial_pose_preference: float = 1.2
    """Factor of the score of an initial pose: another pose must score higher by this factor."""

    fallback_threshold: float = 0.08
    """Minimum agreement of the best pose; below it, or with a large free-space violation, the
    fallback search runs."""

    def __post_init__(self) -> None:
        require_at_least("initial_pose_preference", self.initial_pose_preference, 1.0)
        require_fraction("fallback_threshold", self.fallback_threshold)

    @property
    def covariance_factor(self) -> float:
        """Ratio of actual to estimated deviations, see `Method.covariance_factor`."""
        return self.initial_method.covariance_factor if self.fine is None else 0.85

    def prepare(self, cloud: PointCloud, log: PreparationLog | None = None) -> AutoData:
        """Compute clusters, BEV grid, verification features and fine cells of a scan."""
        log = log or PreparationLog()
        extractor = self.initial_method.extractor
        initial_radii = [scale.max_radius for scale in self.initial_method.schedule.scales]
        multi_start_radii = [scale.max_radius for scale in self.multi_start.scales]
        radii = sorted({*initial_radii, *multi_start_radii}, reverse=True)
        with log.stage("ground"):
            ground = extractor.segmenter.ground.find(cloud)
        clusters = extractor.extract_above(cloud, ground, radii, log.clock)
        at_radius = dict(zip(radii, clusters.gaussians, strict=True))
        with log.stage("bev"):
            bev_grid = None if self.search is None else self.search.project(cloud, ground)
            has_ground = ground.status is not GroundStatus.NONE
            level_from_scan = level_pose(cloud, ground) if has_ground else None
        with log.stage("features"):
            features = features_from_clusters(clusters, self.range_imager)
        with log.stage("cells"):
            fine = None if self.fine is None else self.fine.prepare(cloud)
            refinement = self.sparse_refinement if cloud.takes_sparse_settings else None
            sparse = None if refinement is None else refinement.prepare(cloud)
        data = AutoData(
            clusters=replace(clusters, gaussians=tuple(at_radius[one] for one in initial_radii)),
            multi_start_gaussians=tuple(at_radius[one] for one in multi_start_radii),
            bev_grid=bev_grid,
            level_from_scan=level_from_scan,
            features=features,
            fine=fine,
            sparse=sparse,
        )
        if data.insufficient_reason:
            raise InsufficientData(data.insufficient_reason)
        for note in clusters.notes:
            log.note(note)
        if fine is not None:
            log.note(f"{len(fine.gaussians)} cells of {cloud.scale * fine.cell_size:g} m")
        log.features = features
        return data

    def align(
        self,
        target: AutoData,
        source: AutoData,
        start: Pose | None = None,
        constraints: Constraints = UNCONSTRAINED,
    ) -> Solution:
        """Estimate the pose, target from source; see `Method.align`.

        Parameters
        ----------
        target, source : AutoData
            From `prepare`.
        start : Pose, optional
            Initial pose: one more hypothesis, and the value of the locked directions (without
            one, that of the identity).
        constraints : Constraints
            Locked directions and prior.

        Returns
        -------
        Solution
            The chosen pose; its `candidates` are all distinct refined poses.
        """
        pair = AutoPair(target=target, source=source, initial=start, constraints=constraints)
        refined, history = self._refine(pair, self._hypotheses(pair), start, INITIAL)
        ranked = self._rank(pair, refined)
        if self._needs_fallback(ranked):
            identity = Pose.identity() if start is None else None
            hypotheses = self._fallback_hypotheses(pair)
            refined, further_history = self._refine(pair, hypotheses, identity, "identity")
            ranked = self._rank(pair, refined, ranked)
            history += further_history
        similar, further_history = self._refine_similar(pair, ranked[0])
        ranked = judged_poses(pair, self._rank(pair, similar, ranked))
        history += further_history
        best = self._refine_sparsely(pair, ranked[0])
        history += () if best is ranked[0] else best.solution.history
        ranked[0] = best
        return replace(
            best.solution,
            history=history,
            candidates=tuple(one.candidate for one in ranked),
            runner_up_ratio=runner_up_ratio(ranked),
        )

    def _hypotheses(self, pair: AutoPair) -> list[Hypothesis]:
        """Propose poses: prior, BEV correlation, and cluster matching if a ground is missing."""
        hypotheses: list[Hypothesis] = []
        if pair.constraints.prior is not None:
            prior = pair.constraints.prior.pose
            hypotheses.append(Hypothesis(pose=prior, score=1.0, proposed_by="prior"))
        hypotheses += _correlate(self.search, pair)
        if not pair.both_have_level_grids:
            hypotheses += self._match_clusters(pair)
        return hypotheses

    def _fallback_hypotheses(self, pair: AutoPair) -> list[Hypothesis]:
        """Propose more poses: wider BEV correlation, sorted by plausibility; cluster matching."""
        hypotheses = _correlate(self.fallback_search, pair)
        hypotheses.sort(key=lambda one: one.score * pair.plausibility(one.pose), reverse=True)
        hypotheses = hypotheses[:_MAX_FALLBACK_HYPOTHESES]
        if pair.both_have_level_grids:
            hypotheses += self._match_clusters(pair)
            # The ground may be a wall: match at any roll and pitch too.
            hypotheses += self._match_clusters(pair, any_tilt=True)
        return hypotheses

    def _match_clusters(self, pair: AutoPair, any_tilt: bool = False) -> list[Hypothesis]:
        if self.matcher is None:
            return []
        # Not part of `prepare`: few pairs need it.
        target, source = (
            self.matcher.describe(
                scan.multi_start_gaussians[0], None if any_tilt else scan.level_from_scan
            )
            for scan in (pair.target, pair.source)
        )
        return self.matcher.hypotheses(target, source)

    def _refine(
        self,
        pair: AutoPair,
        hypotheses: list[Hypothesis],
        start: Pose | None,
        proposed_by: str,
    ) -> tuple[list[RefinedHypothesis], tuple[Iteration, ...]]:
        """Refine hypotheses, and a start if given; also return all evaluations."""
        refined: list[RefinedHypothesis] = []
        history: tuple[Iteration, ...] = ()
        if pair.both_have_clusters:
            refined, history = self.multi_start.refine(
                pair.target.multi_start_gaussians,
                pair.source.multi_start_gaussians,
                [replace(one, pose=pair.constrained(one.pose)) for one in hypotheses],
                pair.constraints,
                pair.plausibility,
            )
            refined = [self._refine_finely(pair, one) for one in refined]
        if start is not None:
            refined += self._refine_start(pair, start, proposed_by, refined)
        return refined, history + tuple(step for one in refined for step in one.solution.history)

    def _refine_similar(
        self, pair: AutoPair, best: ScoredPose
    ) -> tuple[list[RefinedHypothesis], tuple[Iteration, ...]]:
        """Refine the poses similar to the best one; see `similar_hypotheses`."""
        if best.solution.reason is StopReason.EMPTY_OBJECTIVE or not pair.both_have_clusters:
            return [], ()
        return self._refine(pair, similar_hypotheses(pair, best.solution.pose), None, "")

    def _refine_start(
        self, pair: AutoPair, start: Pose, proposed_by: str, known: list[RefinedHypothesis]
    ) -> list[RefinedHypothesis]:
        """Refine a start by SGC-NDT and fine NDT, and by fine NDT alone.

        Fine NDT alone keeps an accurate start, which the coarse scales might lose. If SGC-NDT
        ends at a known pose, that pose is returned instead; the only one if the start is near it.
        """
        refined: list[RefinedHypothesis] = []
        if pair.both_have_clusters:
            solution = self.initial_method.align(
                pair.target.clusters, pair.source.clusters, start, pair.constraints
            )
            same = [one for one in known if self._is_near(one, solution.pose)]
            if same:
                solution = replace(same[0].solution, history=solution.history)
                one = RefinedHypothesis(proposed_by=proposed_by, solution=solution)
                if self._is_near(one, start, _MAX_START_DISTANCE):
                    return [one]
                refined.append(one)
            else:
                one = RefinedHypothesis(proposed_by=proposed_by, solution=solution)
                refined.append(self._refine_finely(pair, one))
        solution = self._fine_ndt(pair, start)
        if solution is not None:
            refined.append(RefinedHypothesis(proposed_by=proposed_by, solution=solution))
        return refined

    def _refine_finely(self, pair: AutoPair, refined: RefinedHypothesis) -> RefinedHypothesis:
        """Refine further by fine NDT; return the input if there are no correspondences."""
        solution = self._fine_ndt(pair, refined.solution.pose)
        if solution is None or solution.reason is StopReason.EMPTY_OBJECTIVE:
            return refined
        return replace(refined, solution=solution)

    def _refine_sparsely(self, pair: AutoPair, chosen: ScoredPose) -> ScoredPose:
        """Refine the chosen pose of sparse clouds by planes around their points."""
        target, source = pair.target.sparse, pair.source.sparse
        if self.sparse_refinement is None or target is None or source is None:
            return chosen
        start = chosen.solution.pose
        solution = self.sparse_refinement.align(target, source, start, pair.constraints)
        refined = RefinedHypothesis(proposed_by=chosen.candidate.proposed_by, solution=solution)
        if solution.reason.is_converged and self._is_near(refined, start):
            return replace(self._score(pair, refined), score=chosen.score)
        return chosen

    def _fine_ndt(self, pair: AutoPair, start: Pose) -> Solution | None:
        target, source = pair.target.fine, pair.source.fine
        if self.fine is None or target is None or source is None:
            return None
        return self.fine.align(target, source, start, pair.constraints)

    def _is_near(self, refined: RefinedHypothesis, pose: Pose, factor: float = 1.0) -> bool:
        """Return whether two poses are closer than a multiple of the minimum separation."""
        translation, rotation = (factor * one for one in self.multi_start.min_separation)
        return refined.solution.pose.is_close(pose, translation=translation, rotation=rotation)

    def _rank(
        self, pair: AutoPair, refined: list[RefinedHypothesis], ranked: Sequence[ScoredPose] = ()
    ) -> list[ScoredPose]:
        """Score refined poses; return the distinct ones, ranked ones included, best first."""
        scored = [*ranked, *(self._score(pair, one) for one in refined)]
        return ranked_poses(scored, self.multi_start.min_separation)

    def _score(self, pair: AutoPair, refined: RefinedHypothesis) -> ScoredPose:
        return score_pose(pair, refined, self.initial_pose_preference)

    def _needs_fallback(self, ranked: list[ScoredPose]) -> bool:
        """Return whether no pose is plausible with sufficient agreement."""
        if not ranked:
            return True
        best = ranked[0].candidate
        return not (best.is_plausible and best.agreement >= self.fallback_threshold)


def _correlate(search: BevSearch | None, pair: AutoPair) -> list[Hypothesis]:
    target, source = pair.target.bev_grid, pair.source.bev_grid
    if search is None or target is None or source is None:
        return []
    return search.hypotheses(target, source)
