"""``scanlock register --pairs`` and ``scanlock register-many``: the pairs of a table."""

import time
from collections import Counter
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from scanlock.cli.method_options import MethodOptions
from scanlock.cli.option_types import CovarianceName, Flag
from scanlock.cli.scan_input import Reading
from scanlock.errors import InvalidInput, require_count

if TYPE_CHECKING:
    from scanlock.pipelines.many.pair import Pair
    from scanlock.pipelines.many.pair_row import PairRows

_REASONS = 5
"""Maximum number of reasons that are printed."""


def register_many(
    pairs: Path,
    /,
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"])],
    resume: Flag = False,
    overwrite: Flag = False,
    how: MethodOptions | None = None,
    covariance: CovarianceName = "none",
    workers: int | None = None,
    executor: Literal["processes", "threads"] = "processes",
    scheduler: str | None = None,
    reading: Reading | None = None,
) -> int:
    """Register every pair of a table, and write one row for each.

    Parameters
    ----------
    pairs : Path
        Table of pairs: CSV with the header source,target, and optionally initial (a pose file) and
        name; other columns are repeated in the results. Paths are relative to its folder.
    output : Path
        File of rows, .csv or .jsonl; each row is appended as soon as it is known.
    resume : bool
        Keep the rows of an existing output, and register the pairs that it lacks.
    overwrite : bool
        Replace an existing output.
    covariance : str
        Estimate the covariance of each pose; see scanlock register.
    workers : int
        Number of processes or threads; all cores by default.
    executor : str
        Processes, or threads of one process, which need less memory.
    scheduler : str
        Address of a Dask scheduler, tcp://host:8786, whose workers read and register the scans.

    Returns
    -------
    int
        The exit code: 0 if every pose is verified, 2 if not.
    """
    from scanlock.pipelines.many.pair import read_pairs
    from scanlock.pipelines.many.register_many import register_many as registered
    from scanlock.registration.registry import named_method

    if workers is not None:
        require_count("--workers", workers, 1)
    _check_output(output, resume, overwrite)
    how, reading = how or MethodOptions(), reading or Reading()
    chosen = how.chosen()
    total = sum(1 for _ in read_pairs(pairs))
    run = _Run(pairs, output, total)
    left = run.pairs_left(named_method(chosen)[0], resume)
    if scheduler is None:
        _compile_missing()
    rows = registered(
        left,
        method=chosen,
        dof=how.dof,
        covariance=False if covariance == "none" else covariance,
        executor=scheduler or executor,
        workers=None if scheduler else workers,
        read=reading.reader(),
    )
    return run.write(rows, append=resume)


class _Run:
    """One run over a table of pairs, with the numbers of rows by status."""

    def __init__(self, table: Path, output: Path, total: int) -> None:
        self._table, self._output, self._total = table, output, total
        self._counts = Counter[str]()
        self._reasons = Counter[str]()
        self._kept = 0

    def pairs_left(self, method: str, resume: bool) -> "Iterator[Pair]":
        """Return the pairs of the table that the output lacks."""
        from scanlock.pipelines.many.pair import pair_of, read_pairs
        from scanlock.pipelines.many.row_file import finished_rows

        pairs = (pair_of(pair, number) for number, pair in enumerate(read_pairs(self._table)))
        if resume and self._output.exists():
            self._counts.update(finished_rows(self._output, pairs, method))
        self._kept = self._counts.total()
        return pairs

    def write(self, rows: "PairRows", *, append: bool) -> int:
        """Append the rows to the output as they come, print a summary, return the exit code."""
        from scanlock.cli.errors import complain
        from scanlock.cli.pair_progress import pair_progress
        from scanlock.pipelines.many.pair import extra_columns
        from scanlock.pipelines.many.row_file import RowFile

        begin = time.perf_counter()
        extra = extra_columns(self._table)
        try:
            with (
                RowFile(self._output, extra, append=append) as file,
                pair_progress(self._total, self._counts) as advance,
                closing(rows),
            ):
                for row in rows:
                    file.append(row)
                    self._counts[row.status] += 1
                    if not row.ok:
                        self._reasons[f"{row.status}: {row.reason}"] += 1
                    advance()
        except KeyboardInterrupt:
            complain(
                f"interrupted; {self._output} has {self._counts.total():,} of {self._total:,} "
                "rows, and the same command with --resume continues"
            )
            raise
        self._show(time.perf_counter() - begin)
        return 0 if self._counts["ok"] == self._total else 2

    def _show(self, seconds: float) -> None:
        from scanlock.cli.console import print_facts, print_line, print_status

        ok, new = self._counts["ok"], self._total - self._kept
        print_status(
            "ok" if ok == self._total else "not all ok",
            f"{ok:,} of {self._total:,} pairs are verified",
            good=ok == self._total,
        )
        facts = [(status, f"{count:,}") for status, count in _descending(self._counts)]
        facts += [
            ("reason", f"{count:,} x {text}")
            for text, count in _descending(self._reasons)[:_REASONS]
        ]
        if new:
            rate = f"{new:,} pairs in {seconds:.1f} s, {new / seconds:.1f} a second"
            facts.append(("time", rate))
        print_facts(facts)
        print_line(f"wrote {self._output}")


def _descending(counts: Counter[str]) -> list[tuple[str, int]]:
    return sorted(counts.items(), key=lambda one: -one[1])


def _compile_missing() -> None:
    """Compile the kernels of the default method once, before every worker would."""
    from scanlock.cli.compile_notice import CompileWatch
    from scanlock.registration.compile_ahead import missing_kernels

    missing = missing_kernels(default_only=True)
    if missing:
        CompileWatch().compile_missing(missing)


def _check_output(output: Path, resume: bool, overwrite: bool) -> None:
    from scanlock.cli.output import require_ending
    from scanlock.pipelines.many.row_file import ROW_ENDINGS

    require_ending(output, ROW_ENDINGS, "the output")
    if resume and overwrite:
        raise InvalidInput("give either --resume or --overwrite")
    if output.exists() and not (resume or overwrite):
        raise InvalidInput(
            f"{output} exists; add --resume to register the pairs that it lacks, or --overwrite"
        )
    if not output.parent.is_dir():
        raise InvalidInput(f"the folder {output.parent} of the output does not exist; create it")
