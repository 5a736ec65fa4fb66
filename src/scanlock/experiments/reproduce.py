"""Run an experiment into a folder; an interrupted run goes on where it was."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from scanlock.experiments.experiment import Experiment, Findings, Outcome, Watch, unwatched
from scanlock.experiments.forest import FOREST
from scanlock.experiments.ladar.experiment import LADAR
from scanlock.experiments.page import preface, write_findings
from scanlock.experiments.series import ScanSeries
from scanlock.experiments.urban import URBAN
from scanlock.pipelines.study import Study, StudyRecord
from scanlock.pipelines.study_records import stored_records

EXPERIMENTS = {experiment.name: experiment for experiment in (URBAN, FOREST, LADAR)}
"""Every experiment by name."""

RECORDS = "records.jsonl"


@dataclass(frozen=True, slots=True, eq=False)
class Reproduction:
    """A finished experiment.

    Attributes
    ----------
    outcome : Outcome
    findings : Findings
    page : Path
        The file that leads through all others.
    """

    outcome: Outcome
    findings: Findings
    page: Path


def reproduce(
    experiment: Experiment, series: ScanSeries, folder: Path, watch: Watch = unwatched
) -> Reproduction:
    """Run an experiment and write everything into a folder.

    Each registration is on disk as soon as it is done; those of an earlier run with the same
    settings are not done again.

    Parameters
    ----------
    experiment : Experiment
    series : ScanSeries
        What to register.
    folder : Path
        Created if it is not there.
    watch : Watch, optional
        Is told of every registration, and of every scan that is laid into the maps.

    Raises
    ------
    MissingExtra
        Matplotlib is not installed.
    """
    folder.mkdir(parents=True, exist_ok=True)
    pairs = experiment.pairs(series)
    study = Study(
        methods={one.name: one.method for one in experiment.contenders},
        pairs=pairs,
        load=series.load,
        starts=experiment.starts,
    )
    records = stored_records(folder / RECORDS, study, series.key)
    done = list(watch(records, len(study), "registering"))
    outcome = Outcome(series=series, pairs=pairs, records=_by_contender(experiment, done))
    findings = experiment.examine(outcome, watch)
    introduction = preface(experiment, series)
    page = write_findings(folder, experiment.title, introduction, study.methods, findings)
    return Reproduction(outcome, findings, page)


def _by_contender(
    experiment: Experiment, records: Sequence[StudyRecord]
) -> dict[str, list[StudyRecord]]:
    return {
        one.name: [record for record in records if record.task.method == one.name]
        for one in experiment.contenders
    }
