"""Das et al. 2013, section VIII-B: pairs of a robot's walk through a sparse forest, its map."""

from collections.abc import Mapping

from scanlock.experiments.claims import accurate, crisper, loses_pairs, more_accurate
from scanlock.experiments.crispness import crispness_remarks, crispness_table
from scanlock.experiments.experiment import (
    Claim,
    Experiment,
    Findings,
    Outcome,
    Section,
    Watch,
)
from scanlock.experiments.maps import lay_maps
from scanlock.experiments.pairwise import (
    SOLVED,
    TRUTH,
    error_table,
    pair_table,
    tracks_of,
)
from scanlock.experiments.paper_methods import D2D, G_ICP, P2D, forest_contenders
from scanlock.experiments.series import ScanSeries, simulated_series
from scanlock.report.map_figure import map_figure

PRINTED = {G_ICP: 44_609, P2D: 41_884, D2D: 40_560}
"""Table I of the paper, WPI: filled voxels of 0.1 m."""

_EVERY = 50

_DRAWN = (TRUTH, G_ICP, P2D, D2D)

_ABOUT = """\
Section VIII-B of Das, Servos and Waslander 2013 registers every fiftieth scan of a slow robot's
Velodyne HDL-32E in a sparse forest at Worcester Polytechnic Institute with the scan before, from no
motion at all, by the two methods that did best in the city. The true poses were not known there, so
the paper judges by the maps alone: Table I counts the voxels of 0.1 m that each fills, and Figure 4
looks at two of them from above and from near by."""


def _simulated(scans: int, seed: int) -> ScanSeries:
    return simulated_series("forest", "hdl_32e", every=_EVERY, scans=scans, seed=seed)


def _examine(outcome: Outcome, watch: Watch) -> Findings:
    tracks = tracks_of(outcome)
    laid = lay_maps(outcome.series, tracks, [name for name in _DRAWN if name in tracks], watch)
    counts = {name: laid.crispness(name) for name in laid.points}
    return Findings(
        sections=[
            Section(
                title="Crispness of the maps (Table I)",
                tables={"crispness": crispness_table(counts, PRINTED, G_ICP)},
                remarks=crispness_remarks(outcome, counts, PRINTED, G_ICP),
            ),
            Section(title="The maps (Figure 4)", figures={"maps": map_figure(laid.drawn)}),
            Section(
                title="Accuracy, which the paper could not measure",
                text=f"A pair is solved within {SOLVED} of its true pose, where that is known.",
                tables={"errors": error_table(outcome), "pairs": pair_table(outcome)},
            ),
            Section(title="What the paper concludes", claims=_claims(outcome, counts)),
        ],
        trajectories=tracks,
        times=outcome.series.times,
        maps=laid.points,
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
    about=_ABOUT,
    contenders=forest_contenders(),
    simulated=_simulated,
    scans=40,
    every=_EVERY,
    examine=_examine,
)
"""Section VIII-B, Figure 4 and the second row of Table I."""
