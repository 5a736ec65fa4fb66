"""Scan file arguments of the commands."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Group, Parameter

from scanlock.cli.option_types import FormatName
from scanlock.errors import FormatError

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import ArrayLike

    from scanlock.arrays import Points
    from scanlock.io import ScanFile

_GROUP = Group("Reading scans", sort_key=10)


@dataclass(frozen=True, slots=True, eq=False)
class LoadedScan:
    """A scan file and its usable points.

    Attributes
    ----------
    path : Path
    file : ScanFile
        The contents of the file.
    points : (n, 3) [m]
        One row per row of the file, with NaN for rows at (0, 0, 0), which drivers write where
        there was no return.
    blanks : int
        Number of rows at (0, 0, 0).
    """

    path: Path
    file: "ScanFile"
    points: "Points"
    blanks: int

    @property
    def returns(self) -> "Points":
        """The points without the rows at (0, 0, 0)."""
        return self.points[~(self.file.points == 0.0).all(axis=1)] if self.blanks else self.points

    def summary(self) -> str:
        """Return the file name and the number of points."""
        text = f"{self.path}, {len(self.points):,} points"
        return f"{text}, {self.blanks:,} of them blank (0, 0, 0)" if self.blanks else text

    @property
    def is_in_other_units(self) -> bool:
        """Whether the coordinates of the file are not in metres."""
        return self.file.metres_per_unit != (1.0, 1.0, 1.0)


def system_notes(source: LoadedScan, target: LoadedScan) -> list[str]:
    """Return notes on units and coordinate systems that a user must know of."""
    notes = [
        f"{role}: {note}; the pose is in metres"
        for role, scan in (("source", source), ("target", target))
        if scan.is_in_other_units
        for note in scan.file.notes
        if "metres" in note or "units of" in note
    ]
    systems = [scan.file.crs for scan in (source, target)]
    codes = {crs.epsg for crs in systems if crs is not None and crs.epsg is not None}
    if len(codes) == 2:
        labels = " and ".join(crs.label for crs in systems if crs is not None)
        notes.append(f"the scans have different coordinate systems: {labels}")
    return notes


@Parameter(name="*", group=_GROUP)
@dataclass(frozen=True, kw_only=True, slots=True)
class Reading:
    """Options for reading scan files."""

    format: Annotated[
        FormatName | None, Parameter(help="Format, if the file name does not give it.")
    ] = None
    """Key of `scanlock.io.FORMATS`."""

    columns: Annotated[
        str | None,
        Parameter(
            help='Columns: 4 or "x y z intensity" of a file without names; '
            '"x=easting y=northing z=height" of one with names.'
        ),
    ] = None
    """Number or names of the columns, or a choice among those of the file."""

    scale: Annotated[
        float | None,
        Parameter(help="Unit of the file in metres: 0.001 for millimetres, 0.3048 for feet."),
    ] = None
    """Size of the unit of the file [m], in place of the one that the file states."""

    def wanted_columns(self) -> int | str | None:
        """Return `columns` in the form that `scanlock.io.read_scan` takes."""
        text = self.columns
        return int(text) if text is not None and text.strip().isdecimal() else text

    def reader(self) -> "Callable[[Path], ArrayLike]":
        """Return a function that reads the points of a file, for other processes too."""
        from functools import partial

        from scanlock.pipelines.many.work import read_points

        return partial(
            read_points, format=self.format, columns=self.wanted_columns(), scale=self.scale
        )

    def load(self, path: Path) -> LoadedScan:
        """Read a scan file.

        Raises
        ------
        FormatError
            No row is a point, or an error of `scanlock.io.read_scan`.
        InvalidInput
            Coordinates are longitude and latitude.
        """
        import numpy as np

        from scanlock.io import read_scan

        file = read_scan(path, self.format, columns=self.wanted_columns(), scale=self.scale)
        if file.crs is not None:
            file.crs.require_lengths(str(path))
        blank = (file.points == 0.0).all(axis=1)
        points = np.where(blank[:, None], np.nan, file.points) if blank.any() else file.points
        if not np.isfinite(points).all(axis=1).any():
            raise FormatError(
                f"{path}: none of its {len(points):,} points is finite and not (0, 0, 0); check "
                "the program that wrote it"
            )
        return LoadedScan(path, file, points, int(blank.sum()))
