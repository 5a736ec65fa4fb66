"""``scanlock apply``."""

import numpy as np
import pytest

from scanlock.geometry.pose import Pose
from scanlock.io import read_scan, write_pose, write_scan

_POSE = Pose.from_step(np.array([1.0, 2.0, 3.0, 0.1, -0.2, 0.3]))


@pytest.fixture
def cloud(tmp_path):
    points = np.random.default_rng(0).normal(size=(50, 3))
    write_scan(tmp_path / "cloud.ply", points, {"ring": np.arange(50, dtype=np.uint8)})
    write_pose(tmp_path / "pose.txt", _POSE)
    return tmp_path / "pose.txt", tmp_path / "cloud.ply"


def test_a_cloud_is_moved_with_its_fields(scanlock, cloud, tmp_path):
    output = tmp_path / "moved.pcd"
    done = scanlock("apply", *cloud, "-o", output)
    assert (done.code, done.err) == (0, "")
    assert done.out == f"wrote {output}, 50 points\n"
    scan, moved = read_scan(cloud[1]), read_scan(output)
    np.testing.assert_allclose(moved.points, _POSE.apply(scan.points), atol=1e-12)
    np.testing.assert_array_equal(moved.fields["ring"], scan.fields["ring"])


def test_the_inverse_returns_the_cloud(scanlock, cloud, tmp_path):
    moved, back = tmp_path / "moved.ply", tmp_path / "back.ply"
    scanlock("apply", *cloud, "-o", moved)
    assert scanlock("apply", cloud[0], moved, "-o", back, "--inverse").code == 0
    np.testing.assert_allclose(read_scan(back).points, read_scan(cloud[1]).points, atol=1e-12)


@pytest.mark.parametrize(
    ("name", "part"),
    [
        ("moved.jpg", "the cloud must end in"),
        ("moved.vtp", "the cloud must end in"),
        ("new/moved.ply", "is no folder"),
        ("cloud.ply", "overwritten"),
    ],
)
def test_an_impossible_output_is_refused(scanlock, cloud, tmp_path, name, part):
    before = cloud[1].read_bytes()
    done = scanlock("apply", *cloud, "-o", tmp_path / name)
    assert (done.code, done.out) == (1, "")
    assert part in done.err
    assert cloud[1].read_bytes() == before


def test_a_missing_output_is_named(scanlock, cloud):
    done = scanlock("apply", *cloud)
    assert done.code == 1
    assert "--output" in done.err
