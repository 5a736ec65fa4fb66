import json

import numpy as np

from scanlock.io import write_scan


def test_maps_are_compared_by_their_occupied_voxels(scanlock, tmp_path):
    grid = np.mgrid[0:1:0.05, 0:1:0.05, 0:1:0.5].reshape(3, -1).T + 0.01
    write_scan(tmp_path / "crisp.ply", grid)
    write_scan(tmp_path / "blurred.ply", np.vstack([grid, grid + np.array([0.0, 0.0, 0.1])]))
    done = scanlock("crispness", tmp_path / "crisp.ply", tmp_path / "blurred.ply", "--json")
    content = json.loads(done.out)
    assert [row["voxels"] for row in content["maps"]] == [200, 400]
    assert content["notes"] == []
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


def test_maps_of_different_numbers_of_scans_are_refused(scanlock, tmp_path):
    points = np.random.default_rng(0).uniform(-20.0, 20.0, (3000, 3))
    for name, scans in (("a", 20), ("b", 19), ("c", 6)):
        write_scan(tmp_path / f"{name}.ply", points, {"scan": np.arange(3000) % scans})
    paths = [tmp_path / f"{name}.ply" for name in "abc"]
    assert scanlock("crispness", *paths[:2], "--threads", "2").code == 0
    done = scanlock("crispness", *paths)
    assert (done.code, done.out) == (1, "")
    assert f"got 20 scans in {paths[0]} and 6 in {paths[2]}" in done.err


def test_a_note_names_a_map_of_another_size(scanlock, tmp_path):
    points = np.random.default_rng(0).uniform(-20.0, 20.0, (3000, 3))
    write_scan(tmp_path / "a.ply", points)
    write_scan(tmp_path / "near.ply", points + 0.2)
    write_scan(tmp_path / "wide.ply", 2.0 * points)
    done = scanlock("crispness", *(tmp_path / f"{name}.ply" for name in ("a", "near", "wide")))
    assert done.code == 0
    [note] = [line for line in done.out.splitlines() if line.startswith("note: ")]
    assert f"{tmp_path / 'wide.ply'} extends over 7" in note
    assert "only maps of the same scans are comparable" in note
