"""City experiment of Das et al. 2013, section VIII-A: accuracy of pairs and of the map."""

from collections.abc import Mapping

from scanlock.experiments.claims import (
    accurate,
    crisper,
    equally_crisp,
    judged,
    largest_errors,
    loses_pairs,
    low_errors,
    more_accurate,
)
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
    ERROR_PANELS,
    SOLVED,
    TRUTH,
    error_table,
    pair_table,
    trajectories_of,
)
from scanlock.experiments.paper_methods import D2D, G_ICP, ICP, NDT, P2D, urban_contenders
from scanlock.experiments.series import ScanSeries, simulated_series
from scanlock.report.box_figure import BoxPanel, box_figure
from scanlock.report.map_figure import map_figure

PUBLISHED = {ICP: 132_507, G_ICP: 124_911, P2D: 125_767, D2D: 125_221}
"""Table I of the paper, row Ford: number of filled voxels of 0.1 m."""

_EVERY = 10

_DRAWN = (TRUTH, ICP, G_ICP, NDT, P2D, D2D)

_DESCRIPTION = """\
Section VIII-A of Das, Servos and Waslander 2013 registers every tenth scan of the Ford Campus
drive (Velodyne HDL-64E) with the previous scan, from the identity. ICP has a maximum correspondence
distance of 10 m, NDT has cells of 3 m, and optimisations end when the norm of the gradient or of
the step is below 1e-6. Figure 3 has box plots of the errors against the inertial navigation, and
Table I counts the filled voxels of 0.1 m of each map; a smaller number means a crisper map."""


def _simulate(scans: int, seed: int) -> ScanSeries:
    return simulated_series("street", "hdl_64e", every=_EVERY, scans=scans, seed=seed)


def _analyse(outcome: Outcome, progress: Progress) -> Findings:
    trajectories = trajectories_of(outcome)
    drawn = [name for name in _DRAWN if name in trajectories]
    maps = build_maps(outcome.series, trajectories, drawn, progress)
    counts = maps.counts
    return Findings(
        sections=[
            *_accuracy(outcome),
            crispness_section(outcome, counts, PUBLISHED, G_ICP),
            Section(
                title="Claims of the paper",
                claims=judged(_claims(outcome, counts), len(outcome.pairs)),
            ),
            Section(title="The maps", figures={"maps": map_figure(maps.drawn)}),
        ],
        trajectories=trajectories,
        times=outcome.series.times,
        maps=maps.points,
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
        f"A pair is solved within {SOLVED} of its true pose. Boxes span the quartiles, whiskers "
        "end at the last value within 1.5 times the box height. The paper has the figure without "
        "numbers."
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
        equally_crisp(
            "Both SGC-NDT algorithms and G-ICP generate maps of high quality (0.7 % apart).",
            counts,
            [P2D, D2D, G_ICP],
            0.02,
        ),
    ]


URBAN = Experiment(
    name="urban",
    title="Accuracy in outdoor urban environments",
    description=_DESCRIPTION,
    contenders=urban_contenders(),
    simulate=_simulate,
    scans=101,
    every=_EVERY,
    analyse=_analyse,
)
"""Section VIII-A, Figure 3 and the first row of Table I."""
