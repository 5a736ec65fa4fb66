import json

import numpy as np

from scanlock.io import write_scan


def test_maps_are_compared_by_their_occupied_voxels(scanlock, tmp_path):
    grid = np.mgrid[0:1:0.05, 0:1:0.05, 0:1:0.5].reshape(3, -1).T + 0.01
    write_scan(tmp_path / "crisp.ply", grid)
    write_scan(tmp_path / "blurred.ply", np.vstack([grid, grid + np.array([0.0, 0.0, 0.1])]))
    done = scanlock("crispness", tmp_path / "crisp.ply", tmp_path / "blurred.ply", "--json")
    assert [row["voxels"] for row in json.loads(done.out)["maps"]] == [200, 400]
    wide = scanlock("crispness", tmp_path / "crisp.ply", "--voxel-size", "0.5")
    assert wide.out.split()[-4:-1] == ["8", "0.5", "800"]
    assert scanlock("crispness", tmp_path / "crisp.ply", "--voxel-size", "0").code == 1


def test_maps_far_from_the_origin_share_one_grid(scanlock, tmp_path):
    rng = np.random.default_rng(0)
    far = np.array([500_000.0, 5_400_000.0, 120.0])
    points = rng.uniform(-20.0, 20.0, (3000, 3)) + far
    # With more points on one side, the medians of the maps differ, but not the grid.
    more = np.vstack([points, points[:2000] + np.array([60.0, 10.0, 1.0])])
    write_scan(tmp_path / "a.npy", points)
    write_scan(tmp_path / "b.npy", more)
    done = scanlock(
        "crispness", tmp_path / "a.npy", tmp_path / "b.npy", "--voxel-size", "0.7", "--json"
    )
    counts = [row["voxels"] for row in json.loads(done.out)["maps"]]
    origin = np.round(np.median(points[:: max(1, len(points) // 512)], axis=0))
    expected = [len(np.unique(np.floor((m - origin) / 0.7), axis=0)) for m in (points, more)]
    assert counts == expected
    alone = scanlock("crispness", tmp_path / "b.npy", "--voxel-size", "0.7", "--json")
    assert json.loads(alone.out)["maps"][0]["voxels"] != counts[1]
