"""From any starting pose, or none, to millimetres: hypotheses, descents, fine stage, choice."""

from dataclasses import dataclass, field, replace

from scanlock.clouds.point_cloud import PointCloud
from scanlock.errors import require_at_least
from scanlock.geometry.pose import Pose
from scanlock.models.range_image import RangeImager
from scanlock.objectives.restraint import FREE, Restraint
from scanlock.registration.agreement import judged, violation
from scanlock.registration.auto_scan import AutoScan
from scanlock.registration.candidate import Candidate, plausibility
from scanlock.registration.descents import Descent, Descents
from scanlock.registration.fine_stage import FineStage
from scanlock.registration.heading_search import HeadingSearch
from scanlock.registration.hypothesis import Hypothesis
from scanlock.registration.sgc_ndt import SgcNdt
from scanlock.registration.stages import StageClock
from scanlock.solvers.solution import Iteration, Solution
from scanlock.solvers.stopping import StopReason

_INITIAL = "initial pose"


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """What a search ended with.

    Attributes
    ----------
    solution : Solution
        The pose chosen, with the history of all descents.
    candidates : tuple of Candidate
        All finished poses, the chosen one first.
    """

    solution: Solution
    candidates: tuple[Candidate, ...]


@dataclass(frozen=True, kw_only=True, slots=True)
class Auto:
    """Settings of the default method; `prepare` each scan once, `find` or `align` any pair."""

    search: HeadingSearch | None = field(default_factory=HeadingSearch)
    """Proposes poses from the scans themselves; None leaves it out."""

    basin: SgcNdt = field(default_factory=SgcNdt)
    """Descends from an initial pose by its full schedule, which forgives 10 m and 60 degrees."""

    descents: Descents = field(default_factory=Descents)
    """Descends from the hypotheses."""

    imager: RangeImager | None = field(default_factory=RangeImager)
    """Says which poses put things where the other scan looked through; None leaves it out."""

    fine: FineStage | None = field(default_factory=FineStage)
    """Ends what the descents have left; None leaves it out."""

    loyalty: float = 1.2
    """An initial pose is left for another only if the agreement there is this many times as
    good: who gives one usually knows."""

    def __post_init__(self) -> None:
        require_at_least("loyalty", self.loyalty, 1.0)

    def prepare(self, cloud: PointCloud) -> AutoScan:
        """Return what the method keeps of a scan."""
        clock = StageClock()
        finder = self.basin.landmarks
        with clock.stage("ground"):
            ground = finder.segmenter.ground.find(cloud)
        basin = [scale.largest_radius for scale in self.basin.schedule.scales]
        near = [scale.largest_radius for scale in self.descents.scales]
        radii = sorted({*basin, *near}, reverse=True)
        found = finder.find_above(cloud, ground, radii)
        parts = dict(zip(radii, found.gaussians, strict=True))
        with clock.stage("view"):
            view = None if self.search is None else self.search.view(cloud, ground)
        with clock.stage("ranges"):
            ranges = None if self.imager is None else self.imager.image(cloud)
        with clock.stage("cells"):
            fine = None if self.fine is None else self.fine.prepare(cloud)
        return AutoScan(
            cloud,
            replace(found, gaussians=tuple(parts[radius] for radius in basin)),
            tuple(parts[radius] for radius in near),
            view,
            ranges,
            fine,
            {**clock.seconds, **found.timings},
        )

    def align(
        self, target: AutoScan, source: AutoScan, start: Pose, restraint: Restraint = FREE
    ) -> Solution:
        """Return the pose that carries the source onto the target, given an initial one."""
        return self.find(target, source, start, restraint).solution

    def find(
        self,
        target: AutoScan,
        source: AutoScan,
        initial: Pose | None = None,
        restraint: Restraint = FREE,
    ) -> Found:
        """Return the pose that carries the source onto the target, and what else there was.

        Parameters
        ----------
        target, source : AutoScan
        initial : Pose, optional
            One hypothesis more, and where locked directions are held; the identity by default.
        restraint : Restraint
        """
        start = initial or Pose.identity()
        ended, history = self._descents(target, source, initial, restraint)
        ended = [self._refined(target, source, one, restraint) for one in ended]
        if initial is not None or not ended:
            # A start close by must not be lost on the way through coarser scales.
            ended += self._straight_from(target, source, start, restraint)
        rivals = [(judged(target, source, one), one.solution) for one in _supported(ended)]
        rivals.sort(key=lambda rival: self._standing(rival[0], restraint), reverse=True)
        history += tuple(step for one in ended for step in one.solution.history)
        return Found(
            replace(rivals[0][1], history=history), tuple(candidate for candidate, _ in rivals)
        )

    def _descents(
        self, target: AutoScan, source: AutoScan, initial: Pose | None, restraint: Restraint
    ) -> tuple[list[Descent], tuple[Iteration, ...]]:
        """Return where hypotheses and initial pose lead; none where scans lack clusters."""
        if not (target.has_parts and source.has_parts):
            return [], ()
        start = initial or Pose.identity()
        hypotheses = [
            replace(one, pose=restraint.held(one.pose, start))
            for one in self._hypotheses(target, source, restraint)
        ]
        ended, history = self.descents.follow(
            target.parts,
            source.parts,
            hypotheses,
            restraint,
            lambda pose: plausibility(violation(target, source, pose)),
        )
        if initial is not None or not ended:
            solution = self.basin.align(target.landmarks, source.landmarks, start, restraint)
            ended.append(Descent(_INITIAL, solution))
        return ended, history

    def _hypotheses(
        self, target: AutoScan, source: AutoScan, restraint: Restraint
    ) -> list[Hypothesis]:
        found: list[Hypothesis] = []
        if restraint.prior is not None:
            found.append(Hypothesis(restraint.prior.pose, 1.0, "prior"))
        if self.search is not None and target.view is not None and source.view is not None:
            found += self.search.hypotheses(target.view, source.view)
        return found

    def _refined(
        self, target: AutoScan, source: AutoScan, descent: Descent, restraint: Restraint
    ) -> Descent:
        if self.fine is None or target.fine is None or source.fine is None:
            return descent
        pose = descent.solution.pose
        solution = self.fine.align(target.fine, source.fine, pose, restraint)
        return (
            descent
            if solution.reason is StopReason.NO_SUPPORT
            else replace(descent, solution=solution)
        )

    def _straight_from(
        self, target: AutoScan, source: AutoScan, start: Pose, restraint: Restraint
    ) -> list[Descent]:
        if self.fine is None or target.fine is None or source.fine is None:
            return []
        return [Descent(_INITIAL, self.fine.align(target.fine, source.fine, start, restraint))]

    def _standing(self, candidate: Candidate, restraint: Restraint) -> float:
        """Return how good a candidate is; the best is chosen."""
        standing = candidate.agreement
        if candidate.maker == _INITIAL:
            standing *= self.loyalty
        if restraint.prior is not None:
            standing -= restraint.prior.linearise(candidate.target_from_source).value / 100
        return standing


def _supported(ended: list[Descent]) -> list[Descent]:
    """Return the descents that ended where anything meets; all of them if there is none."""
    met = [one for one in ended if one.solution.reason is not StopReason.NO_SUPPORT]
    return met or ended
