"""The records of a study as lines of JSON that an interrupt leaves whole.

A record is on disk before the next one is begun, and a line that was cut short by a power failure
or a full disk is dropped when the file is opened again. Records carry the digest of all that made
them, so that changed settings or scans never meet old results.
"""

import hashlib
import json
import math
import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from scanlock import __version__
from scanlock.geometry.pose import Pose
from scanlock.io.errors import malformed
from scanlock.pipelines.study import Study, StudyRecord, StudyTask

_HEAD = b'{"key": "'
"""How every line begins."""

_REMEDY = "remove the line, or name another file"

_NUMBERS = {
    "overlap": "overlap",
    "score": "score",
    "mean_distance": "mean_distance_m",
    "translation_error": "translation_error_m",
    "rotation_error": "rotation_error_rad",
}
"""Attributes of a record that are numbers, or NaN, by their names in the file."""


def record_keys(study: Study, scans: str) -> dict[StudyTask, str]:
    """Return a digest of everything that decides the record of each task.

    Parameters
    ----------
    study : Study
    scans : str
        What decides the points of the scans besides their names: a folder, or a seed.
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
    """Yield the records of a study in their order; those in the file are not made again.

    Each new record is written, and safe on disk, before it is yielded.

    Parameters
    ----------
    path : path-like
        The file; created if it is not there. Two runs must not write one file at once.
    study, scans : Study, str
        As for `record_keys`.

    Raises
    ------
    FormatError
        The file holds something else than records.
    """
    path = Path(path)
    keys = record_keys(study, scans)
    stored = _read_and_mend(path)
    known = {task: stored[key] for task, key in keys.items() if key in stored}
    with path.open("ab") as handle:
        for record in study.records(known):
            if record.task not in known:
                handle.write(_line(keys[record.task], record))
                handle.flush()
                os.fsync(handle.fileno())
            yield record


def read_records(path: str | os.PathLike[str]) -> dict[str, StudyRecord]:
    """Return the records of a file by their keys; of two with one key, the later.

    Raises
    ------
    FormatError
        A line that is no record, by its number.
    """
    path = Path(path)
    whole, _ = _split(path, path.read_bytes())
    return _parsed(path, whole)


def _read_and_mend(path: Path) -> dict[str, StudyRecord]:
    if not path.exists():
        return {}
    whole, torn = _split(path, path.read_bytes())
    records = _parsed(path, whole)
    if torn:
        with path.open("r+b") as handle:
            handle.truncate(len(whole))
    return records


def _split(path: Path, data: bytes) -> tuple[bytes, bytes]:
    """Return the whole lines, and what an interrupted writer left behind them."""
    end = data.rfind(b"\n") + 1
    whole, torn = data[:end], data[end:]
    # After a power failure, the part that was not yet on disk may read as zeros.
    text = torn.rstrip(b"\0")
    if not (text.startswith(_HEAD) or _HEAD.startswith(text)):
        raise malformed(
            path,
            f"line {whole.count(10) + 1}",
            expected="a record",
            found=repr(torn[:20]),
            remedy=_REMEDY,
        )
    return whole, torn


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
