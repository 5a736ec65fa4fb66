import pytest

from scanlock.errors import FormatError
from scanlock.io import read_scan

_PACKED = """ply
format binary_little_endian 1.0
element chunk 1
property float min_x
element vertex 1
property uint packed_position
property uint packed_rotation
end_header
"""


@pytest.mark.parametrize(
    ("name", "content", "title", "command"),
    [
        ("a.bag", b"#ROSBAG V2.0\n", "a ROS bag", "rosrun pcl_ros bag_to_pcd {} TOPIC FOLDER"),
        ("a.mcap", b"\x89MCAP0\r\n", "an MCAP", "ros2 bag play {}"),
        ("a.db3", b"SQLite format 3\0", "an SQLite (ROS 2 bag)", "ros2 run pcl_ros"),
        ("a.pcap", b"\xd4\xc3\xb2\xa1\2\0\4\0", "a pcap", "ouster-cli source {} save"),
        ("a.pcap", b"\xa1\xb2\xc3\xd4\0\2\0\4", "a pcap", "v.read_pcap('{}')"),
        ("a.pcapng", b"\x0a\x0d\x0d\x0a\0\0", "a pcapng", "ouster-cli source {} save"),
        ("a.pcd.gz", b"\x1f\x8b\x08\0", "a gzip", "gunzip -k {}"),
        ("a.pcd.bz2", b"BZh9", "a bzip2", "bunzip2 -k {}"),
        ("a.pcd.xz", b"\xfd7zXZ\0", "an xz", "unxz -k {}"),
        ("a.pcd.zst", b"\x28\xb5\x2f\xfd", "a Zstandard", "unzstd {}"),
        ("a.zip", b"PK\x03\x04", "a zip", "unzip {}"),
        ("a.drc", b"DRACO\2\2", "a Draco", "draco_decoder -i {} -o"),
        ("a.rcp", b"\1\2\3", "an Autodesk ReCap project", "export it as E57"),
        ("a.rcs", b"\1\2\3", "an Autodesk ReCap scan", "export it as E57"),
        ("a.fls", b"\1\2\3", "a FARO scan", "export it as E57 from FARO SCENE"),
        ("a.zfs", b"\1\2\3", "a Zoller", "export it as E57 from Z+F LaserControl"),
        ("a.png", b"\x89PNG\r\n", "a PNG", "first"),
    ],
)
def test_the_converter_of_known_formats_is_named(save, name, content, title, command):
    path = save(name, content + bytes(100))
    with pytest.raises(FormatError) as caught:
        read_scan(path)
    assert f"found {title}" in str(caught.value)
    assert command.format(path) in str(caught.value)


@pytest.mark.parametrize("name", ["a.bin", "a.unknown", "a.txt", "a.pcd"])
def test_other_formats_are_recognised_under_any_name(save, name):
    with pytest.raises(FormatError, match="found a ROS bag file; convert it first: with R"):
        read_scan(save(name, b"#ROSBAG V2.0\n" + bytes(100)))
    with pytest.raises(FormatError, match="found a PNG file; convert it to one of bin, npy"):
        read_scan(save(name, b"\x89PNG" + bytes(100)))


def test_packed_splats_are_refused_with_their_converter(save):
    path = save("a.compressed.ply", _PACKED.encode() + bytes(12))
    with pytest.raises(FormatError, match=r"npx @playcanvas/splat-transform .*a\.compressed\.ply "):
        read_scan(path)
