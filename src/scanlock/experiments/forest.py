"""Forest experiment of Das et al. 2013, section VIII-B: accuracy of pairs and of the map."""

from collections.abc import Mapping

from scanlock.experiments.claims import accurate, crisper, judged, loses_pairs, more_accurate
from scanlock.experiments.crispness import crispness_section
from scanlock.experiments.experiment import (
    Claim,
    Experiment,
    Findings,
    Outcome,
    Progress,
    Section,
)
from scanlock.experiments.maps import build_maps
from scanlock.experiments.pairwise import (
    SOLVED,
    TRUTH,
    error_table,
    pair_table,
    trajectories_of,
)
from scanlock.experiments.paper_methods import D2D, G_ICP, P2D, forest_contenders
from scanlock.experiments.series import ScanSeries, simulated_series
from scanlock.report.map_figure import map_figure

PUBLISHED = {G_ICP: 44_609, P2D: 41_884, D2D: 40_560}
"""Table I of the paper, row WPI: number of filled voxels of 0.1 m."""

_EVERY = 50

_DRAWN = (TRUTH, G_ICP, P2D, D2D)

_DESCRIPTION = """\
Section VIII-B of Das, Servos and Waslander 2013 registers every fiftieth scan of a slow robot's
Velodyne HDL-32E in a sparse forest at Worcester Polytechnic Institute with the previous scan, from
the identity, by the two methods that performed best in the city. The true poses are unknown, so the
paper evaluates the maps alone: Table I counts the filled voxels of 0.1 m of each, and Figure 4
shows two of them as a whole and in detail."""


def _simulate(scans: int, seed: int) -> ScanSeries:
    return simulated_series("forest", "hdl_32e", every=_EVERY, scans=scans, seed=seed)


def _analyse(outcome: Outcome, progress: Progress) -> Findings:
    trajectories = trajectories_of(outcome)
    drawn = [name for name in _DRAWN if name in trajectories]
    maps = build_maps(outcome.series, trajectories, drawn, progress)
    counts = maps.counts
    return Findings(
        sections=[
            crispness_section(outcome, counts, PUBLISHED, G_ICP),
            Section(title="The maps (Figure 4)", figures={"maps": map_figure(maps.drawn)}),
            Section(
                title="Accuracy (not measured in the paper)",
                text=f"A pair is solved within {SOLVED} of its true pose, if that is known.",
                tables={"errors": error_table(outcome), "pairs": pair_table(outcome)},
            ),
            Section(
                title="Claims of the paper",
                claims=judged(_claims(outcome, counts), len(outcome.pairs)),
            ),
        ],
        trajectories=trajectories,
        times=outcome.series.times,
        maps=maps.points,
    )


def _claims(outcome: Outcome, counts: Mapping[str, int]) -> list[Claim]:
    return [
        crisper(
            "The maps of both SGC-NDT algorithms are crisper than that of G-ICP.",
            counts,
            [P2D, D2D],
            [G_ICP],
        ),
        crisper("The map of SGC-NDT-D2D is the crispest.", counts, [D2D], [P2D, G_ICP]),
        more_accurate(
            "G-ICP was not able to provide accurate results as compared to SGC-NDT.",
            outcome,
            [P2D, D2D],
            [G_ICP],
        ),
        loses_pairs(
            "G-ICP shows occasionally poor convergence to local minima, SGC-NDT stays crisp.",
            outcome,
            G_ICP,
            [P2D, D2D],
        ),
        accurate(
            "SGC-NDT gives good registrations where local surfaces are poor.",
            outcome,
            [P2D, D2D],
        ),
    ]


FOREST = Experiment(
    name="forest",
    title="Accuracy in sparse forested environments",
    description=_DESCRIPTION,
    contenders=forest_contenders(),
    simulate=_simulate,
    scans=40,
    every=_EVERY,
    analyse=_analyse,
)
"""Section VIII-B, Figure 4 and the second row of Table I."""
