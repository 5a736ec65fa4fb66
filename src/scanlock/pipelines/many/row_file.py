"""Rows in a CSV or JSON Lines file that grows while pairs are registered.

Each row is appended as one line. A line that was cut short, by a kill or a full disk, is removed
when the file is opened again.
"""

import csv
import io
import json
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

from scanlock.errors import FormatError, InvalidInput
from scanlock.pipelines.many.pair import Pair
from scanlock.pipelines.many.pair_row import COLUMNS, PairRow
from scanlock.pipelines.many.work import path_text

ROW_ENDINGS = (".csv", ".jsonl")
"""Endings of the names of files of rows."""


class RowFile(AbstractContextManager["RowFile"]):
    """File of rows, open to append further ones.

    Parameters
    ----------
    path : Path
        A new file, or one that `finished_rows` has checked.
    extra : sequence of str
        Names of the further columns.
    append : bool
        Whether to keep the rows of an existing file.
    """

    def __init__(self, path: Path, extra: Sequence[str], *, append: bool) -> None:
        self._is_csv = path.suffix.lower() == ".csv"
        self._columns = (*COLUMNS, *extra)
        append = append and path.exists()
        if append:
            _remove_incomplete_line(path)
        # Without a buffer, so that each line is one write.
        self._handle = path.open("ab" if append else "wb", buffering=0)
        if self._is_csv and self._handle.tell() == 0:
            self._write(_csv_line(self._columns))

    def append(self, row: PairRow) -> None:
        """Append a row."""
        values = {name: _one_line(value) for name, value in row.as_dict().items()}
        if self._is_csv:
            self._write(_csv_line([_cell(values.get(name)) for name in self._columns]))
        else:
            self._write(json.dumps(values, allow_nan=False) + "\n")

    def __exit__(self, *_: object) -> None:
        os.fsync(self._handle.fileno())
        self._handle.close()

    def _write(self, line: str) -> None:
        # The encoding of a name that is not UTF-8 must not end the run.
        data = memoryview(line.encode(errors="backslashreplace"))
        while data:
            data = data[self._handle.write(data) or 0 :]


def finished_rows(path: Path, pairs: Iterator[Pair], method: str) -> Iterator[str]:
    """Advance `pairs` by those that a file of rows has already, and yield the status of each.

    Raises
    ------
    FormatError
        The file is not a file of rows.
    InvalidInput
        A row of the file is not that of the pair, or of another method.
    """
    for number, row in enumerate(_stored(path), start=1):
        pair = next(pairs, None)
        found = [row["name"], *(Path(row[role]).name for role in ("source", "target"))]
        if pair is None or found != [
            pair.name,
            *(Path(path_text(scan)).name for scan in (pair.source, pair.target)),
        ]:
            raise InvalidInput(
                f"{path}: row {number} ({row['name']}) is not that of pair {number} of the list, "
                "so the run cannot resume; use the same list, or --overwrite"
            )
        if row["method"] not in ("", None, method):
            raise InvalidInput(
                f"{path}: its rows are of the method {row['method']}, not {method}; use the same "
                "method, or --overwrite"
            )
        yield row["status"]


def _stored(path: Path) -> Iterator[Mapping[str, Any]]:
    """Yield the complete rows of a file."""
    with path.open("rb") as handle:
        lines = (line.decode() for line in handle if line.endswith(b"\n"))
        try:
            if path.suffix.lower() == ".csv":
                reader = csv.DictReader(lines)
                if not {"name", "source", "target", "status", "method"} <= {
                    *(reader.fieldnames or ("name", "source", "target", "status", "method"))
                }:
                    raise ValueError("other columns")
                yield from reader
            else:
                yield from (json.loads(line) for line in lines)
        except (ValueError, csv.Error) as error:
            raise FormatError(
                f"{path}: expected rows of scanlock register-many, found other content ({error}); "
                "use another file, or --overwrite"
            ) from error


def _remove_incomplete_line(path: Path) -> None:
    with path.open("r+b") as handle:
        end = handle.seek(0, os.SEEK_END)
        while end > 0:
            begin = max(0, end - 65536)
            handle.seek(begin)
            last = handle.read(end - begin).rfind(b"\n")
            if last >= 0:
                handle.truncate(begin + last + 1)
                return
            end = begin
        handle.truncate(0)


def _csv_line(cells: Sequence[str]) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerow(cells)
    return text.getvalue()


def _cell(value: object) -> str:
    if value is None:
        return ""
    return str(value).lower() if isinstance(value, bool) else str(value)


def _one_line(value: Any) -> Any:
    return " ".join(value.splitlines()) if isinstance(value, str) else value
