from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from scanlock import Pose, segment
from scanlock.evaluation.crispness import crispness
from scanlock.experiments.experiment import unwatched
from scanlock.experiments.maps import lay_maps


def test_scans_lie_where_their_trajectories_put_them(series):
    tracks = {"true": series.true_trajectory(), "still": [Pose.identity()] * 4}
    laid = lay_maps(series, tracks, ["true"], unwatched)
    for name, poses in tracks.items():
        every = [
            pose.apply(series.load(scan)) for scan, pose in zip(series.names, poses, strict=True)
        ]
        assert laid.crispness(name) == crispness(np.concatenate(every))
    assert laid.crispness("true") < laid.crispness("still")


def test_what_is_drawn_stands_above_the_ground(series):
    poses = series.true_trajectory()
    drawn = lay_maps(series, {"true": poses}, ["true"], unwatched).drawn
    assert list(drawn) == ["true"]
    standing = [
        pose.apply(series.load(scan)[~segment(series.load(scan)).is_ground])
        for scan, pose in zip(series.names, poses, strict=True)
    ]
    # Each scan keeps float32 before it is moved, a rounding away.
    distances, _ = cKDTree(np.concatenate(standing)).query(drawn["true"].standing)
    assert len(distances) > 1000
    assert distances.max() < 1e-4
    np.testing.assert_array_equal(drawn["true"].path, [pose.translation for pose in poses])
    assert drawn["true"].caption.endswith("voxels")


def test_a_scan_that_cannot_be_read_is_left_out(series):
    def load(name):
        return np.full((5, 3), np.nan) if name == "scan1" else series.load(name)

    tracks = {"true": series.true_trajectory()}
    whole = lay_maps(series, tracks, [], unwatched)
    part = lay_maps(replace(series, load=load), tracks, [], unwatched)
    assert 0 < part.crispness("true") < whole.crispness("true")
