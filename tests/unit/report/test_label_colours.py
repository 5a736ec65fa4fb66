import numpy as np
import pytest

from scanlock.io import read_scan, write_scan
from scanlock.report.label_colours import label_colours, viewer_fields


def test_ground_neither_and_clusters_differ():
    labels = np.arange(-1, 40)
    colours = label_colours(labels)
    assert colours.dtype == np.uint8
    assert len(np.unique(colours, axis=0)) == len(labels)
    # Consecutive clusters are far apart.
    steps = np.abs(np.diff(colours[2:].astype(int), axis=0)).max(axis=1)
    assert steps.min() > 80
    np.testing.assert_array_equal(label_colours(np.array([3, 0, 3])), colours[[4, 1, 4]])


@pytest.mark.parametrize("ending", [".ply", ".pcd"])
def test_open3d_shows_the_colours(tmp_path, ending):
    open3d = pytest.importorskip("open3d")
    colours = label_colours(np.arange(-1, 20))
    points = np.random.default_rng(0).random((21, 3))
    path = tmp_path / f"a{ending}"
    write_scan(path, points, viewer_fields(colours, ending))
    cloud = open3d.io.read_point_cloud(str(path))
    np.testing.assert_array_equal(np.round(255 * np.asarray(cloud.colors)), colours)
    assert len(read_scan(path)) == 21
