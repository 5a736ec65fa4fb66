import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scanlock.errors import InvalidInput
from scanlock.evaluation.crispness import crispness
from scanlock.evaluation.voxel_map import VoxelMap

RNG = np.random.default_rng(0)
CHUNKS = [RNG.normal(0.0, 1.0, (500, 3)) for _ in range(7)]


def test_one_point_is_kept_in_each_occupied_voxel():
    voxels = VoxelMap(0.1)
    for chunk in CHUNKS:
        voxels.add(chunk)
    everything = np.concatenate(CHUNKS)
    assert len(voxels) == len(voxels.points) == crispness(everything, 0.1)
    kept = {tuple(row) for row in voxels.points.tolist()}
    assert kept <= {tuple(row) for row in everything.astype(np.float32).tolist()}


def test_the_first_point_of_a_voxel_is_kept():
    voxels = VoxelMap(1.0)
    voxels.add(np.array([[0.2, 0.2, 0.2], [0.1, 0.1, 0.1], [5.5, 0.5, 0.5]]))
    voxels.add(np.array([[0.9, 0.9, 0.9], [-0.5, 0.5, 0.5]]))
    np.testing.assert_allclose(
        voxels.points, [[-0.5, 0.5, 0.5], [0.2, 0.2, 0.2], [5.5, 0.5, 0.5]], rtol=1e-6
    )


def test_reading_the_length_between_scans_does_not_change_the_map():
    one, other = VoxelMap(0.1), VoxelMap(0.1)
    for chunk in CHUNKS:
        one.add(chunk)
        other.add(chunk)
        assert len(other) > 0
    np.testing.assert_array_equal(one.points, other.points)


def test_a_map_without_points_is_empty():
    voxels = VoxelMap(0.1)
    voxels.add(np.zeros((0, 3)))
    assert (len(voxels), voxels.points.shape) == (0, (0, 3))


def test_points_beyond_the_grid_and_invalid_sizes_are_refused():
    with pytest.raises(InvalidInput, match="within 104858 m"):
        VoxelMap(0.1).add(np.array([[2e5, 0.0, 0.0]]))
    with pytest.raises(InvalidInput, match="voxel_size must be positive"):
        VoxelMap(0.0)


@given(
    st.lists(
        st.lists(
            st.tuples(st.integers(0, 3), st.one_of(st.just(np.nan), st.integers(0, 255))),
            min_size=1, max_size=8,
        ),
        min_size=1, max_size=5,
    )
)  # fmt: skip
def test_a_voxel_has_the_mean_of_a_field_and_the_value_of_its_first_point(scans):
    voxels, values, numbers = VoxelMap(1.0), {}, {}
    for number, scan in enumerate(scans):
        points = np.array([[place + 0.5, 0.5, 0.5] for place, _ in scan])
        field = np.array([value for _, value in scan], np.float32)
        first = {"scan": np.full(len(scan), number, np.int32)}
        voxels.add(points, first=first, means={"intensity": field})
        for place, value in scan:
            values.setdefault(place, []).append(value)
            numbers.setdefault(place, number)
    places = sorted(values)
    expected = [[one for one in values[place] if not np.isnan(one)] for place in places]
    means = [np.mean(known) if known else np.nan for known in expected]
    assert voxels.points[:, 0].tolist() == [place + 0.5 for place in places]
    assert voxels.fields["scan"].dtype == np.int32
    assert voxels.fields["scan"].tolist() == [numbers[place] for place in places]
    np.testing.assert_allclose(voxels.fields["intensity"], means, rtol=1e-12)
