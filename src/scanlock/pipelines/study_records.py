"""Records of a study in a JSON Lines file, so that an interrupted study can be resumed.

Each record is on disk before the next registration starts. A line that was cut short by a power
failure or a full disk is dropped when the file is opened again. Records carry a digest of all
their inputs, so that a record made with other settings or scans is never reused.
"""

import hashlib
import json
import math
import os
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from scanlock import __version__
from scanlock.geometry.pose import Pose
from scanlock.io.errors import malformed
from scanlock.pipelines.study import Study, StudyRecord, StudyTask

TIMES = "times.jsonl"
"""Name of the file of wall times, in the folder of the records."""

_HEAD = b'{"key": "'
"""First bytes of every line."""

_REMEDY = "remove the line, or choose another file"

_NUMBERS = {
    "overlap": "overlap",
    "score": "score",
    "mean_distance": "mean_distance_m",
    "translation_error": "translation_error_m",
    "rotation_error": "rotation_error_rad",
}
"""Names in the file of the attributes of a record that are numbers, or NaN."""


def record_keys(study: Study, scans: str) -> dict[StudyTask, str]:
    """Return a digest of all inputs of each task, as the key of its record.

    Parameters
    ----------
    study : Study
    scans : str
        Origin of the scans, such as a folder or a seed, which their names alone do not identify.
    """
    truths = {pair.name: _rows(pair.truth) for pair in study.pairs}
    settings = {name: repr(method) for name, method in study.methods.items()}
    keys: dict[StudyTask, str] = {}
    for task in study.tasks():
        parts = [
            __version__, scans, task.pair, truths[task.pair], task.method, settings[task.method],
            task.start, study.starts.rule,
        ]  # fmt: skip
        keys[task] = hashlib.sha256(json.dumps(parts).encode()).hexdigest()[:24]
    return keys


def stored_records(path: str | os.PathLike[str], study: Study, scans: str) -> Iterator[StudyRecord]:
    """Run a study and yield its records in order, reusing the records and times on disk.

    Each new record is written and synchronised to disk before it is yielded.

    Parameters
    ----------
    path : path-like
        The file; created if missing. Only one process at a time may write it.
    study, scans : Study, str
        As for `record_keys`.

    Raises
    ------
    FormatError
        The file is not a file of records.
    """
    path = Path(path)
    keys = record_keys(study, scans)
    stored = _read_and_truncate(path)
    seconds = _read_times(path.with_name(TIMES))
    known = {
        task: replace(stored[key], seconds=seconds.get(key, math.nan))
        for task, key in keys.items()
        if key in stored
    }
    with path.open("ab") as handle, path.with_name(TIMES).open("ab") as times:
        for record in study.records(known):
            if record.task not in known:
                # A time without a record does no harm, but a record without a time is a gap.
                if math.isfinite(record.seconds):
                    times.write(_time_line(keys[record.task], record))
                    times.flush()
                handle.write(_line(keys[record.task], record))
                handle.flush()
                os.fsync(handle.fileno())
            yield record


def read_records(path: str | os.PathLike[str]) -> dict[str, StudyRecord]:
    """Read the records of a file, by key; of several with one key, the last.

    Raises
    ------
    FormatError
        A line that is not a record; the message gives its number.
    """
    path = Path(path)
    complete, _ = _split(path, path.read_bytes())
    return _parsed(path, complete)


def _read_and_truncate(path: Path) -> dict[str, StudyRecord]:
    """Read the records of a file and remove an incomplete last line from it."""
    if not path.exists():
        return {}
    complete, rest = _split(path, path.read_bytes())
    records = _parsed(path, complete)
    if rest:
        with path.open("r+b") as handle:
            handle.truncate(len(complete))
    return records


def _split(path: Path, data: bytes) -> tuple[bytes, bytes]:
    """Split the bytes of a file into complete lines and an incomplete last one."""
    end = data.rfind(b"\n") + 1
    complete, rest = data[:end], data[end:]
    # After a power failure, bytes that were not yet on disk may read as zeros.
    text = rest.rstrip(b"\0")
    if not (text.startswith(_HEAD) or _HEAD.startswith(text)):
        raise malformed(
            path,
            f"line {complete.count(10) + 1}",
            expected="a record",
            found=repr(rest[:20]),
            remedy=_REMEDY,
        )
    return complete, rest


def _parsed(path: Path, data: bytes) -> dict[str, StudyRecord]:
    records: dict[str, StudyRecord] = {}
    for number, line in enumerate(data.splitlines(), start=1):
        try:
            content = json.loads(line)
            records[content["key"]] = _record(content)
        except (ValueError, KeyError, TypeError, IndexError) as error:
            raise malformed(
                path,
                f"line {number}",
                expected="a record",
                found=f"other content ({type(error).__name__}: {error})",
                remedy=_REMEDY,
            ) from error
    return records


def _line(key: str, record: StudyRecord) -> bytes:
    content: dict[str, Any] = {
        "key": key,
        "pair": record.task.pair,
        "method": record.task.method,
        "start": record.task.start,
        "status": record.status,
        "reason": record.reason,
        "start_pose": _rows(record.start),
        "pose": _rows(record.pose),
        "evaluations": record.evaluations,
        "centre_m": list(record.centre),
        "notes": list(record.notes),
    }
    for attribute, name in _NUMBERS.items():
        value = float(getattr(record, attribute))
        content[name] = None if math.isnan(value) else value
    return json.dumps(content, allow_nan=False).encode() + b"\n"


def _record(content: Mapping[str, Any]) -> StudyRecord:
    numbers = {
        attribute: math.nan if content[name] is None else float(content[name])
        for attribute, name in _NUMBERS.items()
    }
    return StudyRecord(
        task=StudyTask(content["pair"], content["method"], content["start"]),
        status=content["status"],
        reason=content["reason"],
        start=_pose(content["start_pose"]),
        pose=_pose(content["pose"]),
        evaluations=int(content["evaluations"]),
        centre=_triple(content["centre_m"]),
        notes=tuple(content["notes"]),
        **numbers,
    )


def _time_line(key: str, record: StudyRecord) -> bytes:
    content = {"key": key, "pair": record.task.pair, "method": record.task.method,
               "start": record.task.start, "seconds": record.seconds}  # fmt: skip
    return json.dumps(content).encode() + b"\n"


def _read_times(path: Path) -> dict[str, float]:
    """Return the wall times of a file by key; lines that were cut short are left out."""
    found: dict[str, float] = {}
    for line in path.read_bytes().splitlines() if path.exists() else ():
        with suppress(ValueError, KeyError, TypeError):
            content = json.loads(line)
            found[content["key"]] = float(content["seconds"])
    return found


def _triple(numbers: Any) -> tuple[float, float, float]:
    x, y, z = (float(number) for number in numbers)
    return x, y, z


def _rows(pose: Pose | None) -> list[list[float]] | None:
    return None if pose is None else pose.matrix[:3].tolist()


def _pose(rows: Any) -> Pose | None:
    if rows is None:
        return None
    matrix = np.array(rows, dtype=np.float64)
    return Pose(matrix[:, :3], matrix[:, 3])
