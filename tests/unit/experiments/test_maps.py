from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from scanlock import Pose, segment
from scanlock.evaluation.crispness import crispness
from scanlock.experiments.experiment import no_progress
from scanlock.experiments.maps import build_maps


def test_maps_contain_the_scans_at_the_poses_of_the_trajectory(series):
    trajectories = {"true": series.true_trajectory(), "still": [Pose.identity()] * 4}
    maps = build_maps(series, trajectories, ["true"], no_progress)
    for name, poses in trajectories.items():
        every = [
            pose.apply(series.load(scan)) for scan, pose in zip(series.names, poses, strict=True)
        ]
        assert maps.counts[name] == crispness(np.concatenate(every))
    assert maps.counts["true"] < maps.counts["still"]


def test_drawn_maps_contain_the_points_above_the_ground(series):
    poses = series.true_trajectory()
    drawn = build_maps(series, {"true": poses}, ["true"], no_progress).drawn
    assert list(drawn) == ["true"]
    standing = [
        pose.apply(series.load(scan)[~segment(series.load(scan)).is_ground])
        for scan, pose in zip(series.names, poses, strict=True)
    ]
    # Each scan keeps float32 before it is moved, a rounding away.
    distances, _ = cKDTree(np.concatenate(standing)).query(drawn["true"].points)
    assert len(distances) > 1000
    assert distances.max() < 1e-4
    np.testing.assert_array_equal(drawn["true"].path, [pose.translation for pose in poses])
    assert drawn["true"].caption.endswith("voxels")


def test_a_scan_that_cannot_be_read_is_omitted(series):
    def load(name):
        return np.full((5, 3), np.nan) if name == "scan1" else series.load(name)

    trajectories = {"true": series.true_trajectory()}
    whole = build_maps(series, trajectories, [], no_progress)
    incomplete = build_maps(replace(series, load=load), trajectories, [], no_progress)
    assert 0 < incomplete.counts["true"] < whole.counts["true"]
