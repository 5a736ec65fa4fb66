import numpy as np

from scanlock.evaluation.error_summary import Statistics, summarise_kitti
from scanlock.evaluation.trajectory_errors import kitti_errors
from scanlock.geometry.pose import Pose


def test_statistics_of_known_errors():
    found = Statistics.of(np.array([1.0, 2.0, 6.0]))
    assert (found.mean, found.median, found.smallest, found.largest) == (3.0, 2.0, 1.0, 6.0)
    np.testing.assert_allclose(found.rmse**2, found.mean**2 + found.std**2)


def test_kitti_errors_are_summarised_over_all_segments_and_by_length():
    truth = [Pose(np.eye(3), np.array([2.0 * k, 0.0, 0.0])) for k in range(130)]
    estimate = [Pose(np.eye(3), 1.01 * pose.translation) for pose in truth]
    every, *by_length = summarise_kitti(kitti_errors(estimate, truth))
    assert [one.length_m for one in by_length] == [100.0, 200.0]
    assert every.segments == sum(one.segments for one in by_length)
    # A segment is one step of 2 m longer than its length.
    np.testing.assert_allclose(by_length[0].translation_percent, 1.02)
    np.testing.assert_allclose(by_length[1].translation_percent, 1.01)
    assert summarise_kitti(kitti_errors(truth[:9], truth[:9])) == []
