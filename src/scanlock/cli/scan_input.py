"""Scan files as the commands read them."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Group, Parameter

from scanlock.cli.option_types import FormatName
from scanlock.errors import FormatError

if TYPE_CHECKING:
    from scanlock.arrays import Points
    from scanlock.io import ScanFile

_GROUP = Group("How scans are read", sort_key=10)


@dataclass(frozen=True, slots=True, eq=False)
class LoadedScan:
    """A scan file, and the points to compute with.

    Attributes
    ----------
    path : Path
    file : ScanFile
        The contents, untouched.
    points : (n, 3) [m]
        Row by row as in the file, with NaN for the rows at (0, 0, 0): drivers write them where
        nothing came back, and as points they would pile up at the sensor.
    blanks : int
        How many such rows there are.
    """

    path: Path
    file: "ScanFile"
    points: "Points"
    blanks: int

    @property
    def returns(self) -> "Points":
        """The points without the blank rows."""
        return self.points[~(self.file.points == 0.0).all(axis=1)] if self.blanks else self.points

    def summary(self) -> str:
        """Return the name of the file and how many points it has, for people."""
        text = f"{self.path}, {len(self.points):,} points"
        return f"{text}, {self.blanks:,} of them blank (0, 0, 0)" if self.blanks else text


@Parameter(name="*", group=_GROUP)
@dataclass(frozen=True, kw_only=True, slots=True)
class Reading:
    """How scan files are read; the files themselves tell, where they can."""

    format: Annotated[FormatName | None, Parameter(help="Format, where the name misleads.")] = None
    """Key of `scanlock.io.FORMATS`."""

    columns: Annotated[
        str | None,
        Parameter(help='Columns of a file without names: 4, or "x y z intensity".'),
    ] = None
    """How many columns a headerless file has, or what they are called."""

    def wanted_columns(self) -> int | str | None:
        """Return `columns` as `scanlock.io.read_scan` wants it."""
        text = self.columns
        return int(text) if text is not None and text.strip().isdecimal() else text

    def load(self, path: Path) -> LoadedScan:
        """Return the contents of a scan file.

        Raises
        ------
        FormatError
            No row of it is a point; and all that `scanlock.io.read_scan` raises.
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
