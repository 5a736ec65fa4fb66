import numpy as np
import pytest

from scanlock.io import read_scan

pytestmark = pytest.mark.slow

_RNG = np.random.default_rng(0)
_POINTS = np.round(_RNG.normal(size=(30, 3)) * 20, 3)  # PLY as text has six digits
_COLOURS = _RNG.integers(0, 256, (30, 3))


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """Return a function that writes a cloud with Open3D."""
    open3d = pytest.importorskip("open3d")

    def write(name, **options):
        cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(_POINTS))
        cloud.colors = open3d.utility.Vector3dVector(_COLOURS / 255)
        path = tmp_path_factory.mktemp("open3d") / name
        assert open3d.io.write_point_cloud(str(path), cloud, **options)
        return path

    return write


@pytest.mark.parametrize("options", [{}, {"write_ascii": True}, {"compressed": True}])
@pytest.mark.parametrize("name", ["a.pcd", "a.ply"])
def test_clouds_are_read(written, name, options):
    scan = read_scan(written(name, **options))
    assert np.abs(scan.points - _POINTS).max() < 1e-5


@pytest.mark.parametrize("name", ["a.xyz", "a.xyzrgb", "a.pts"])
def test_text_is_read(written, name):
    scan = read_scan(written(name))
    assert np.abs(scan.points - _POINTS).max() < 1e-6
    if name == "a.pts":
        colours = [scan.fields[key] for key in ("red", "green", "blue")]
        assert np.abs(np.stack(colours, axis=1) - _COLOURS).max() <= 1
