import numpy as np
import pytest

from reference.samples import gaussians
from scanlock.clouds.point_tree import PointTree
from scanlock.errors import InvalidInput
from scanlock.models.voxel_gaussians import VoxelGrid
from scanlock.optimisation.objectives.associations import NearestAssociation, NeighbourCells


def _members(lists, source):
    rows, starts, members = lists
    if rows[source] < 0:
        return set()
    return set(members[starts[rows[source]] : starts[rows[source] + 1]].tolist())


def test_the_nearest_target_has_the_minimum_distance_between_means():
    rng = np.random.default_rng(7)
    target = gaussians(rng, 50)
    positions = rng.uniform(-12.0, 12.0, (80, 3))
    lists = NearestAssociation(PointTree.from_points(target.means)).at(positions)
    distances = np.linalg.norm(positions[:, None] - target.means, axis=2)
    for source, nearest in enumerate(distances.argmin(axis=1).tolist()):
        assert _members(lists, source) == {nearest}


@pytest.mark.parametrize("max_offset", [0, 1, 2])
def test_neighbour_cells_lie_within_the_maximum_offset_along_each_axis(max_offset):
    rng = np.random.default_rng(8)
    voxels = VoxelGrid(offset=0.4).gaussians(rng.normal(0.0, 2.0, (2000, 3)), 1.0)
    positions = rng.normal(0.0, 3.0, (60, 3))
    lists = NeighbourCells(voxels, max_offset).at(positions)
    cells = np.floor(positions - 0.4)
    steps = np.abs(cells[:, None] - voxels.cells).max(axis=2)
    found = [_members(lists, i) for i in range(60)]
    assert found == [set(np.flatnonzero(row <= max_offset).tolist()) for row in steps]
    assert any(found)


def test_a_negative_offset_is_rejected():
    voxels = VoxelGrid().gaussians(np.zeros((10, 3)), 1.0)
    with pytest.raises(
        InvalidInput, match="max_offset must be a whole number of at least 0, got -1"
    ):
        NeighbourCells(voxels, -1)
