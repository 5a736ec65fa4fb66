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
        Parameter(help='Columns of a file without names: 4, or "x y z intensity".'),
    ] = None
    """Number or names of the columns of a headerless file."""

    def wanted_columns(self) -> int | str | None:
        """Return `columns` in the form that `scanlock.io.read_scan` takes."""
        text = self.columns
        return int(text) if text is not None and text.strip().isdecimal() else text

    def reader(self) -> "Callable[[Path], ArrayLike]":
        """Return a function that reads the points of a file, for other processes too."""
        from functools import partial

        from scanlock.pipelines.many.work import read_points

        return partial(read_points, format=self.format, columns=self.wanted_columns())

    def load(self, path: Path) -> LoadedScan:
        """Read a scan file.

        Raises
        ------
        FormatError
            No row is a point, or an error of `scanlock.io.read_scan`.
        """
        import numpy as np

        from scanlock.io import read_scan

        file = read_scan(path, self.format, columns=self.wanted_columns())
        blank = (file.points == 0.0).all(axis=1)
        points = np.where(blank[:, None], np.nan, file.points) if blank.any() else file.points
        if not np.isfinite(points).all(axis=1).any():
            raise FormatError(
                f"{path}: none of its {len(points):,} points is finite and not (0, 0, 0); check "
                "the program that wrote it"
            )
        return LoadedScan(path, file, points, int(blank.sum()))
