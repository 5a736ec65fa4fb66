"""Formats that are recognised but not read, with the command or program that converts them."""

from pathlib import Path

from scanlock.errors import FormatError

_OUSTER = (
    "Ouster: pip install ouster-sdk, then ouster-cli source {file} save {stem}.csv (one file for "
    "each scan)"
)
_VELODYNE = (
    'Velodyne: pip install velodyne-decoder, then python -c "import numpy, velodyne_decoder as v; '
    "[numpy.save(f'{{k:06}}.npy', p[:, :4]) for k, (t, p) in enumerate(v.read_pcap('{file}'))]\""
)
_PACKETS = f"{_OUSTER}; {_VELODYNE}"
_ROS1 = "with ROS 1: rosrun pcl_ros bag_to_pcd {file} TOPIC FOLDER"
_ROS2 = (
    "with ROS 2: ros2 run pcl_ros pointcloud_to_pcd --ros-args -r input:=TOPIC, during ros2 bag "
    "play {file}"
)
_SPLATS = "npx @playcanvas/splat-transform {file} {stem}.splats.ply"

_MAGIC = {
    b"#ROSBAG": ("a ROS bag", _ROS1),
    b"\x89MCAP": ("an MCAP", _ROS2),
    b"SQLite": ("an SQLite (ROS 2 bag)", _ROS2),
    b"\x89HDF": ("an HDF5", ""),
    b"\x1f\x8b\x08": ("a gzip", "gunzip -k {file}"),
    b"BZh": ("a bzip2", "bunzip2 -k {file}"),
    b"\xfd7zXZ\0": ("an xz", "unxz -k {file}"),
    b"\x28\xb5\x2f\xfd": ("a Zstandard", "unzstd {file}"),
    b"7z\xbc\xaf\x27\x1c": ("a 7-Zip", "7z x {file}"),
    b"\xd4\xc3\xb2\xa1": ("a pcap packet capture", _PACKETS),
    b"\xa1\xb2\xc3\xd4": ("a pcap packet capture", _PACKETS),
    b"\x4d\x3c\xb2\xa1": ("a pcap packet capture", _PACKETS),
    b"\xa1\xb2\x3c\x4d": ("a pcap packet capture", _PACKETS),
    b"\x0a\x0d\x0d\x0a": ("a pcapng packet capture", _PACKETS),
    b"DRACO": ("a Draco", "draco_decoder -i {file} -o {stem}.ply"),
    b"\x89PNG": ("a PNG", ""),
    b"ARROW1": ("a Feather", ""),
    b"PAR1": ("a Parquet", ""),
}
"""Title and converter by the first bytes of a file; an empty converter if none is known."""

_EXTENSIONS = {
    ".rcp": ("an Autodesk ReCap project", "export it as E57 from Autodesk ReCap Pro"),
    ".rcs": ("an Autodesk ReCap scan", "export it as E57 from Autodesk ReCap Pro"),
    ".fls": ("a FARO scan", "export it as E57 from FARO SCENE"),
    ".zfs": ("a Zoller + Fröhlich scan", "export it as E57 from Z+F LaserControl"),
}
"""Title and export by the extension, for formats without a public description."""


def refuse_foreign(path: Path, data: bytes, readable: str) -> None:
    """Raise `FormatError` for a format that is recognised but not read.

    Parameters
    ----------
    path : Path
        The file.
    data : bytes
        Its beginning.
    readable : str
        List of the formats that are read, for messages.
    """
    found = _EXTENSIONS.get(path.suffix.lower())
    for magic, known in _MAGIC.items():
        if data.startswith(magic):
            found = known
    if data.startswith(b"PK\x03\x04") and path.suffix.lower() == ".zip":
        found = ("a zip", "unzip {file}")
    if found is None:
        return
    title, converter = found
    remedy = converter.format(file=path, stem=path.with_suffix(""))
    how = f"convert it first: {remedy}" if remedy else f"convert it to one of {readable} first"
    raise FormatError(f"{path}: byte 0: expected a scan, found {title} file; {how}")


def refuse_packed_ply(path: Path, names: list[str]) -> None:
    """Raise `FormatError` for a PLY file of which the coordinates are packed into integers.

    Parameters
    ----------
    path : Path
        The file.
    names : list of str
        Properties of its vertices.
    """
    if "packed_position" in names:
        remedy = _SPLATS.format(file=path, stem=path.with_suffix(""))
        raise FormatError(
            f"{path}: header: expected vertices with x, y and z, found compressed Gaussian splats "
            f"(packed_position); unpack them first: {remedy}"
        )
