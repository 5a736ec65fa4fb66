"""Poses of the stations of an E57 file, changed in the XML section of the file itself."""

import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from xml.parsers import expat

from scanlock.errors import FormatError, InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.geometry.quaternions import pose_from_quaternion
from scanlock.geometry.rotations import quaternion_from_rotation
from scanlock.io.atomic import atomic_file
from scanlock.io.errors import malformed, require_regular_file
from scanlock.io.formats.e57.library import REMEDY
from scanlock.io.formats.e57.pages import read_xml, write_with_xml

_SCANS, _IMAGES = "data3D", "images2D"
_ELEMENT_DEPTH = 3
"""Depth of a scan or an image: e57Root, data3D, vectorChild."""

_VALUES = {
    "guid",
    "associatedData3DGuid",
    *(f"pose/rotation/{axis}" for axis in "wxyz"),
    *(f"pose/translation/{axis}" for axis in "xyz"),
}
"""Paths of the values that are read, within a scan or an image."""


def write_e57_poses(
    source: str | os.PathLike[str],
    output: str | os.PathLike[str],
    poses: Sequence[Pose | None],
) -> None:
    """Copy an E57 file with other poses of its stations; points and images keep every byte.

    The images of a station (panoramas) move with it. pye57 is not needed.

    Parameters
    ----------
    source, output : path-like
        The files; they may be the same.
    poses : sequence of Pose or None
        ``file_from_station`` of each station, in the order of the file; None keeps a pose.

    Raises
    ------
    InvalidInput
        Another number of poses than of stations.
    FormatError
        A source that is damaged or no E57 file.
    FileNotFoundError
        The source, or the folder of the output, does not exist.
    """
    path = Path(source)
    require_regular_file(path, "E57")
    with path.open("rb") as file:
        xml = _with_poses(path, read_xml(path, file), poses)
        with atomic_file(output) as handle:
            write_with_xml(path, file, handle, xml)


def _with_poses(path: Path, xml: bytes, poses: Sequence[Pose | None]) -> bytes:
    """Return the XML section with other poses, and all else unchanged."""
    found = _Elements(path, xml).found
    scans = [one for one in found if one.parent == _SCANS]
    if len(poses) != len(scans):
        raise InvalidInput(
            f"{path}: poses must be one for each of the {len(scans)} stations, got {len(poses)}"
        )
    changes: list[tuple[int, int, Pose]] = []
    motions: dict[str, Pose] = {}
    for scan, pose in zip(scans, poses, strict=True):
        if pose is not None:
            changes.append((*scan.place(path), pose))
            motions[scan.values.get("guid", "")] = pose @ scan.pose(path).inverse()
    for image in found:
        motion = motions.get(image.values.get("associatedData3DGuid", ""))
        if image.parent == _IMAGES and motion is not None and image.span is not None:
            changes.append((*image.span, motion @ image.pose(path)))
    for first, end, pose in sorted(changes, key=lambda change: change[0], reverse=True):
        xml = xml[:first] + _pose_text(pose) + xml[end:]
    return xml


@dataclass(slots=True)
class _Element:
    """A scan or an image in the XML section."""

    parent: str
    """Name of the list: data3D or images2D."""

    insertion: int | None = None
    """Start of the first element in it that is no pose."""

    span: tuple[int, int] | None = None
    """Start and end of its pose; None if it has none."""

    values: dict[str, str] = field(default_factory=dict[str, str])
    """Texts by path."""

    def place(self, path: Path) -> tuple[int, int]:
        """Return the start and end of the pose, or twice the place for a new one."""
        if self.span is not None:
            return self.span
        if self.insertion is None:
            raise _malformed(path, "stations with a name and points", "an empty one")
        return self.insertion, self.insertion

    def pose(self, path: Path) -> Pose:
        """Return the pose; elements that are missing or empty are zero, as in the format."""

        def numbers(part: str, axes: str) -> list[float]:
            return [float(self.values.get(f"pose/{part}/{axis}") or 0.0) for axis in axes]

        try:
            quaternion = numbers("rotation", "wxyz")
            if not any(quaternion):
                quaternion = [1.0, 0.0, 0.0, 0.0]
            return pose_from_quaternion(numbers("translation", "xyz"), quaternion)
        except ValueError as error:
            raise _malformed(path, "poses of numbers", str(error)) from error


class _Elements:
    """Scans and images in the XML section, in the order of the file."""

    def __init__(self, path: Path, xml: bytes) -> None:
        self.xml = xml
        self.stack: list[str] = []
        self.first = 0
        self.found: list[_Element] = []
        self.parser: Any = expat.ParserCreate()
        self.parser.StartElementHandler = self._start
        self.parser.EndElementHandler = self._end
        self.parser.CharacterDataHandler = self._text
        try:
            self.parser.Parse(xml, True)
        except expat.ExpatError as error:
            raise _malformed(path, "well-formed XML", str(error)) from error

    def _start(self, name: str, attributes: dict[str, str]) -> None:
        at = self.parser.CurrentByteIndex
        self.stack.append(name)
        depth = len(self.stack)
        if depth == _ELEMENT_DEPTH and self.stack[1] in (_SCANS, _IMAGES):
            self.found.append(_Element(self.stack[1]))
        elif depth == _ELEMENT_DEPTH + 1 and self._is_inside():
            if name == "pose":
                self.first = at
            elif self.found[-1].insertion is None:
                self.found[-1].insertion = at

    def _end(self, name: str) -> None:
        if len(self.stack) == _ELEMENT_DEPTH + 1 and name == "pose" and self._is_inside():
            end = self.xml.index(b">", self.parser.CurrentByteIndex) + 1
            self.found[-1].span = self.first, end
        self.stack.pop()

    def _text(self, text: str) -> None:
        place = "/".join(self.stack[_ELEMENT_DEPTH:])
        if place in _VALUES and self._is_inside():
            values = self.found[-1].values
            values[place] = values.get(place, "") + text.strip()

    def _is_inside(self) -> bool:
        return self.stack[1] in (_SCANS, _IMAGES)


def _pose_text(pose: Pose) -> bytes:
    quaternion = zip("wxyz", quaternion_from_rotation(pose.rotation).tolist(), strict=True)
    translation = zip("xyz", pose.translation.tolist(), strict=True)
    parts = [
        f'<{key} type="Structure">'
        + "".join(f'<{axis} type="Float">{value!r}</{axis}>' for axis, value in values)
        + f"</{key}>"
        for key, values in (("rotation", quaternion), ("translation", translation))
    ]
    return f'<pose type="Structure">{"".join(parts)}</pose>'.encode("ascii")


def _malformed(path: Path, expected: str, found: str) -> FormatError:
    return malformed(path, "XML section", expected=expected, found=found, remedy=REMEDY)
