"""Reproduction of an experiment into a folder; an interrupted run can be continued."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from scanlock.experiments.experiment import Experiment, Findings, Outcome, Progress, no_progress
from scanlock.experiments.forest import FOREST
from scanlock.experiments.ladar.experiment import LADAR
from scanlock.experiments.page import preface, write_findings
from scanlock.experiments.series import ScanSeries
from scanlock.experiments.urban import URBAN
from scanlock.pipelines.study import Study, StudyRecord
from scanlock.pipelines.study_records import stored_records

EXPERIMENTS = {experiment.name: experiment for experiment in (URBAN, FOREST, LADAR)}
"""All experiments by name."""

RECORDS = "records.jsonl"


@dataclass(frozen=True, slots=True, eq=False)
class Reproduction:
    """Results of an experiment.

    Attributes
    ----------
    outcome : Outcome
    findings : Findings
    page : Path
        Path of the page.
    """

    outcome: Outcome
    findings: Findings
    page: Path


def reproduce(
    experiment: Experiment,
    series: ScanSeries,
    folder: Path,
    progress: Progress = no_progress,
    *,
    threads: int = 1,
) -> Reproduction:
    """Run an experiment and write its results into a folder.

    Each registration is stored as soon as it is finished. Registrations of an earlier run with
    the same settings are not repeated.

    Parameters
    ----------
    experiment : Experiment
    series : ScanSeries
        Scans to register.
    folder : Path
        Output folder; created if necessary.
    progress : Progress, optional
        Report of the registrations and of the scans of the maps.
    threads : int
        Maximum number of threads of a registration; only times depend on it.

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
        threads=threads,
    )
    records = stored_records(folder / RECORDS, study, series.key)
    done = list(progress(records, len(study), "registering"))
    outcome = Outcome(series=series, pairs=pairs, records=_by_contender(experiment, done))
    findings = experiment.analyse(outcome, progress)
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
