"""Scans of a folder for a map, with the fields that the map keeps."""

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any

from scanlock.cli.scan_input import Reading

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from scanlock.arrays import Points
    from scanlock.clouds.point_cloud import PointCloud
    from scanlock.io import ScanFile
    from scanlock.io.crs.coordinate_system import CoordinateSystem
    from scanlock.io.sequences.scan_sequence import ScanSequence

    Values = NDArray[Any]
    Fields = dict[str, Values]

_INTENSITIES = ("intensity", "reflectance", "reflectivity", "remission", "i")

NUMBER, INTENSITY = "scan", "intensity"
"""Fields of a map: number of the scan, which is its row in the trajectory, and intensity."""


class MapScans:
    """Scans by number, with the fields that a map keeps: those of the first scan.

    Parameters
    ----------
    sequence : ScanSequence
    reading : Reading
        Options for reading the files.

    Attributes
    ----------
    crs : CoordinateSystem or None
        Coordinate reference system of the first scan that was read.
    """

    def __init__(self, sequence: "ScanSequence", reading: Reading) -> None:
        self._sequence = sequence
        self._reading = reading
        self._fields: dict[int, tuple[Values | None, Values | None]] = {}
        self.crs: CoordinateSystem | None = None
        self._is_first = True
        self._has_intensity = False
        self._time = ""

    def points(self, numbers: Iterable[int]) -> "Iterator[Points]":
        """Read scans one by one and yield their (n, 3) points [m], without blank rows.

        The fields of a scan are held until `fields` is called.
        """
        for number in numbers:
            yield self._read(number)

    def fields(self, number: int, cloud: "PointCloud") -> "tuple[Fields, Fields]":
        """Return the fields of the points of a scan, once.

        Parameters
        ----------
        number : int
            Number of a scan that was read.
        cloud : PointCloud
            Its points.

        Returns
        -------
        first : dict of str to (n,)
            Fields of which a voxel keeps that of its first point: number of the scan, time.
        means : dict of str to (n,)
            Fields of which a voxel keeps the mean: intensity.
        """
        import numpy as np

        intensity, times = self._fields.pop(number)
        first: Fields = {NUMBER: np.full(len(cloud), number, np.int32)}
        if self._time:
            first[self._time] = _rows_of(times, cloud)
        if not self._has_intensity:
            return first, {}
        return first, {INTENSITY: _rows_of(intensity, cloud).astype(np.float32)}

    def _read(self, number: int) -> "Points":
        from scanlock.io.description.guesses import time_field
        from scanlock.io.formats.registry import format_of_name
        from scanlock.io.formats.stations import split_station

        path = self._sequence.paths[number]
        if format_of_name(split_station(path)[0]) is None and self._reading.format is None:
            # Ford Campus has a reader of its own, without fields.
            self._fields[number] = None, None
            return self._sequence.scan(number)
        scan = self._reading.load(path)
        intensity, time = _intensity_field(scan.file), time_field(scan.file)
        if self._is_first:
            self._has_intensity = intensity is not None
            self._time = "" if time is None else time if time.isidentifier() else "time"
            self.crs, self._is_first = scan.file.crs, False
        kept = [None if name is None else scan.file.fields[name] for name in (intensity, time)]
        if scan.blanks:
            measured = ~(scan.file.points == 0.0).all(axis=1)
            kept = [None if values is None else values[measured] for values in kept]
        self._fields[number] = kept[0], kept[1]
        return scan.returns


def _intensity_field(file: "ScanFile") -> str | None:
    names = {name.lower(): name for name, values in file.fields.items() if values.ndim == 1}
    return next((names[name] for name in _INTENSITIES if name in names), None)


def _rows_of(values: "Values | None", cloud: "PointCloud") -> "Values":
    """Return the values of the points of a cloud; NaN where the scan lacks the field."""
    import numpy as np

    if values is None:
        return np.full(len(cloud), np.nan, np.float32)
    rows = values[cloud.rows]
    # PLY has no integers of 64 bits.
    is_long = values.dtype.kind in "iu" and values.dtype.itemsize > 4
    return rows.astype(np.float64) if is_long else rows
