"""Files of a registration: pose, aligned and merged clouds, picture."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Group, Parameter

from scanlock.cli.option_types import Flag
from scanlock.cli.output import (
    POSE_ENDINGS,
    require_apart,
    require_ending,
    require_folder,
    require_picture,
    require_scan_file,
    save_pose,
)
from scanlock.cli.scan_input import LoadedScan
from scanlock.errors import InvalidInput

if TYPE_CHECKING:
    from scanlock.geometry.pose import Pose
    from scanlock.registration.methods.protocol import Method
    from scanlock.registration.result import RegistrationResult
    from scanlock.report.registration_page import ReportedScan

_GROUP = Group("Files to write", sort_key=5)


@Parameter(name="*", group=_GROUP)
@dataclass(frozen=True, kw_only=True, slots=True)
class ResultFiles:
    """Options for the files that a registration writes."""

    output: Annotated[
        Path | None,
        Parameter(
            name=["--output", "-o"],
            help="Pose, target from source: .txt or .npy (4x4 matrix), or .json (whole result).",
        ),
    ] = None
    """File for the pose."""

    aligned: Annotated[
        Path | None,
        Parameter(help="Source moved onto the target, with all its fields: .ply, .pcd, .las, ..."),
    ] = None
    """File for the source in the target's frame."""

    merged: Annotated[
        Path | None,
        Parameter(help="Target and moved source as one cloud, with a field scan and colours."),
    ] = None
    """File for both scans in the target's frame."""

    picture: Annotated[
        Path | None, Parameter(help="Picture of both scans before and after: .png, .pdf or .svg.")
    ] = None
    """File for the picture."""

    report: Annotated[
        Path | None,
        Parameter(help="Report as one page: outcome, accuracy, pictures, settings: .html."),
    ] = None
    """File for the report."""

    force: Annotated[
        Flag, Parameter(help="Write pose and clouds even if the pose is not verified.")
    ] = False
    """Whether to write files of poses that are not verified."""

    def check(self, inputs: Sequence[Path]) -> None:
        """Raise `InvalidInput` unless every file can be written; before any work."""
        from scanlock.report.canvas import require_figures

        if self.output is not None:
            require_ending(self.output, POSE_ENDINGS, "the pose file")
        if self.picture is not None:
            require_picture(self.picture)
        if self.report is not None:
            require_ending(self.report, (".html",), "the report")
            require_figures()
        for path in (self.aligned, self.merged):
            if path is not None:
                require_scan_file(path)
        known = (self.output, self.aligned, self.merged, self.picture, self.report)
        files = [one for one in known if one is not None]
        for number, path in enumerate(files):
            require_folder(path)
            require_apart(path, inputs)
            if path in files[:number]:
                raise InvalidInput(f"{path} is given for two outputs; use another name for one")

    def write(
        self,
        result: "RegistrationResult",
        source: LoadedScan,
        target: LoadedScan,
        content: Mapping[str, Any],
        method: "Method[Any]",
        start: "Pose | None",
    ) -> list[str]:
        """Write the files, and return a line on each, written or not."""
        lines: list[str] = []
        if self.output is not None:
            lines.append(self._write_pose(self.output, result, content))
        for path, merge in ((self.aligned, False), (self.merged, True)):
            if path is not None:
                lines.append(self._write_cloud(path, result, source, target, merge=merge))
        if self.picture is not None:
            _draw(self.picture, source, target, result, start)
            lines.append(f"wrote {self.picture}")
        if self.report is not None:
            _report(self.report, source, target, result, method, start)
            lines.append(f"wrote {self.report}")
        return lines

    def _write_pose(
        self, path: Path, result: "RegistrationResult", content: Mapping[str, Any]
    ) -> str:
        from scanlock.registration.verification.status import Status

        is_array, is_json = (path.suffix.lower() == ending for ending in (".npy", ".json"))
        failed = result.status is Status.NO_CORRESPONDENCES
        if not (result.ok or self.force or is_json) and (failed or is_array):
            return _left_out(path, result)
        save_pose(path, result.target_from_source, content, comment=_comment(result))
        return f"wrote {path}" + ("" if result.ok else " (it says that the pose is not verified)")

    def _write_cloud(
        self,
        path: Path,
        result: "RegistrationResult",
        source: LoadedScan,
        target: LoadedScan,
        *,
        merge: bool,
    ) -> str:
        from dataclasses import replace

        from scanlock.cli.output import write_cloud
        from scanlock.io.transform import merge_scans, transform_scan

        if not (result.ok or self.force):
            return _left_out(path, result)
        moved = transform_scan(source.file, result.target_from_source)
        # The moved cloud is in the target's coordinates.
        moved = replace(moved, crs=target.file.crs, las=moved.las if moved.las else target.file.las)
        scan = merge_scans([target.file, moved]) if merge else moved
        scan = write_cloud(path, scan)
        return f"wrote {path}, {len(scan):,} points"


def _left_out(path: Path, result: "RegistrationResult") -> str:
    return f"left out {path}: the pose is not verified ({_status(result)}); --force writes it"


def _comment(result: "RegistrationResult") -> str:
    """Return the comment of a pose file; empty for a verified pose."""
    return "" if result.ok else f"not verified: {_status(result)}; {result.reason}"


def _status(result: "RegistrationResult") -> str:
    return result.status.value.replace("_", " ")


def _draw(
    path: Path,
    source: LoadedScan,
    target: LoadedScan,
    result: "RegistrationResult",
    start: "Pose | None",
) -> None:
    from scanlock.report.canvas import save_figure
    from scanlock.report.registration_figure import registration_figure

    figure = registration_figure(
        result, source=source.returns, target=target.returns, initial=start
    )
    save_figure(path, figure)


def _report(
    path: Path,
    source: LoadedScan,
    target: LoadedScan,
    result: "RegistrationResult",
    method: "Method[Any]",
    start: "Pose | None",
) -> None:
    from scanlock.io import atomic_file
    from scanlock.registration.settings.file import settings_to_toml
    from scanlock.report.registration_page import registration_page

    page = registration_page(
        result,
        source=_reported(source),
        target=_reported(target),
        settings=settings_to_toml(method),
        initial=start,
    )
    with atomic_file(path) as handle:
        handle.write(page.encode())


def _reported(scan: LoadedScan) -> "ReportedScan":
    import numpy as np

    from scanlock.report.registration_page import ReportedScan

    crs = scan.file.crs
    system = "" if crs is None else f", {crs.name or f'EPSG {crs.epsg}'}, {crs.horizontal_unit}"
    points = scan.returns[np.isfinite(scan.returns).all(axis=1)]
    facts = f"{len(points):,} points{system}"
    return ReportedScan(title=scan.path.name, facts=facts, points=points)
