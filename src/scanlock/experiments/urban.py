"""Das et al. 2013, section VIII-A: pairs of a city drive, their errors and their map."""

from collections.abc import Mapping

from scanlock.experiments.claims import (
    accurate,
    alike,
    crisper,
    largest_errors,
    loses_pairs,
    low_errors,
    more_accurate,
)
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
    ERROR_PANELS,
    SOLVED,
    TRUTH,
    error_table,
    pair_table,
    tracks_of,
)
from scanlock.experiments.paper_methods import D2D, G_ICP, ICP, NDT, P2D, urban_contenders
from scanlock.experiments.series import ScanSeries, simulated_series
from scanlock.report.box_figure import BoxPanel, box_figure
from scanlock.report.map_figure import map_figure

PRINTED = {ICP: 132_507, G_ICP: 124_911, P2D: 125_767, D2D: 125_221}
"""Table I of the paper, Ford: filled voxels of 0.1 m."""

_EVERY = 10

_DRAWN = (TRUTH, ICP, G_ICP, NDT, P2D, D2D)

_ABOUT = """\
Section VIII-A of Das, Servos and Waslander 2013 registers every tenth scan of the Ford Campus
drive (Velodyne HDL-64E) with the scan before, from no motion at all; ICP with pairs up to 10 m
apart, NDT with cells of 3 m, and optimisations that end once the norm of the gradient or of the
step falls below 1e-6. Figure 3 has box plots of the errors against the inertial navigation, and
Table I counts the voxels of 0.1 m that the map of each method fills: the fewer, the crisper."""


def _simulated(scans: int, seed: int) -> ScanSeries:
    return simulated_series("street", "hdl_64e", every=_EVERY, scans=scans, seed=seed)


def _examine(outcome: Outcome, watch: Watch) -> Findings:
    tracks = tracks_of(outcome)
    laid = lay_maps(outcome.series, tracks, [name for name in _DRAWN if name in tracks], watch)
    counts = {name: laid.crispness(name) for name in laid.points}
    return Findings(
        sections=[
            *_accuracy(outcome),
            Section(
                title="Crispness of the maps (Table I)",
                tables={"crispness": crispness_table(counts, PRINTED, G_ICP)},
                remarks=crispness_remarks(outcome, counts, PRINTED, G_ICP),
            ),
            Section(title="What the paper concludes", claims=_claims(outcome, counts)),
            Section(title="The maps", figures={"maps": map_figure(laid.drawn)}),
        ],
        trajectories=tracks,
        times=outcome.series.times,
        maps=laid.points,
    )


def _accuracy(outcome: Outcome) -> list[Section]:
    tables = {"errors": error_table(outcome), "pairs": pair_table(outcome)}
    if not outcome.series.truth:
        text = "The true poses are not known, so there are no errors to show."
        return [Section(title="Accuracy (Figure 3)", text=text, tables=tables)]
    panels = [
        BoxPanel(title, {name: errors(records) for name, records in outcome.records.items()})
        for title, errors in ERROR_PANELS
    ]
    text = (
        f"A pair is solved within {SOLVED} of its true "
        "pose. Boxes reach from quartile to quartile, whiskers to the last value within 1.5 times "
        "that height. The paper prints the figure and no numbers, so there are none to compare."
    )
    return [
        Section(
            title="Accuracy (Figure 3)",
            text=text,
            tables=tables,
            figures={"errors": box_figure(panels)},
        )
    ]


def _claims(outcome: Outcome, counts: Mapping[str, int]) -> list[Claim]:
    return [
        accurate(
            "Both SGC-NDT algorithms produce accurate results, as does G-ICP.",
            outcome,
            [P2D, D2D, G_ICP],
        ),
        largest_errors(
            "NDT has the large translation errors of poor convergence.",
            outcome,
            NDT,
            [ICP, G_ICP, P2D, D2D],
        ),
        loses_pairs(
            "NDT did not converge to the global minimum on numerous occasions.",
            outcome,
            NDT,
            [ICP, G_ICP, P2D, D2D],
        ),
        low_errors("ICP shows fairly low errors.", outcome, ICP),
        more_accurate(
            "ICP is not as accurate as SGC-NDT or G-ICP.",
            outcome,
            [P2D, D2D, G_ICP],
            [ICP],
        ),
        crisper(
            "ICP produces a map of lesser quality, as registration errors add up.",
            counts,
            [P2D, D2D, G_ICP],
            [ICP],
        ),
        alike(
            "Both SGC-NDT algorithms and G-ICP generate maps of high quality (0.7 % apart).",
            counts,
            [P2D, D2D, G_ICP],
            0.02,
        ),
    ]


URBAN = Experiment(
    name="urban",
    title="Accuracy in outdoor urban environments",
    about=_ABOUT,
    contenders=urban_contenders(),
    simulated=_simulated,
    scans=101,
    every=_EVERY,
    examine=_examine,
)
"""Section VIII-A, Figure 3 and the first row of Table I."""
