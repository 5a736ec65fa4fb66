"""Registration of two scans in Python, from the first call to the use of the pose."""

import json
import math

import numpy as np

import scanlock
from reference.samples import street, yaw_pose


def test_a_registered_pose_aligns_two_scans():
    motion = yaw_pose(0.3, (3.0, -2.0, 0.1))
    target = street(1).astype(np.float32)
    source = motion.inverse().apply(street(2)).astype(np.float32)

    result = scanlock.register(source=source, target=target)

    assert result.ok, result.reason
    moved = result.target_from_source.apply(source)
    metres, radians = result.target_from_source.distance(motion)
    # The tolerances of the contract tests.
    assert metres < 0.1
    assert math.degrees(radians) < 0.3
    # The ground of both scans is at one height.
    heights = [np.median(scan[scanlock.segment(scan).is_ground, 2]) for scan in (target, moved)]
    assert abs(heights[1] - heights[0]) < 0.1
    assert json.loads(result.to_json())["status"] == "ok"


def test_scans_with_any_heading_are_registered_without_an_initial_pose():
    motion = yaw_pose(2.6, (14.0, -3.0, 0.0))
    target, source = street(1), motion.inverse().apply(street(2))

    found = scanlock.register(source=source, target=target)
    assert found.ok, found.reason
    assert found.target_from_source.is_close(motion, translation=0.05, rotation=math.radians(0.1))
    # The best candidate is far better than the runner-up.
    assert found.candidates[0].proposed_by == "BEV correlation"
    assert found.runner_up_ratio < 0.5

    # A wrong initial pose has no effect.
    from_wrong_start = scanlock.register(
        source=source, target=target, initial=yaw_pose(-1.0, (-20.0, 9.0, 0.0))
    )
    assert from_wrong_start.ok, from_wrong_start.reason
    assert from_wrong_start.target_from_source.is_close(
        motion, translation=0.05, rotation=math.radians(0.1)
    )


def test_a_failure_has_a_reason_and_a_better_initial_pose_succeeds():
    motion = yaw_pose(2.6, (4.0, -3.0, 0.0))
    target, source = street(1), motion.inverse().apply(street(2))

    failed = scanlock.register(source=source, target=target, method="sgc-ndt-d2d")
    assert not failed.ok
    assert failed.status is scanlock.Status.UNVERIFIED
    assert "pose is likely wrong" in failed.reason

    # An initial pose with errors of 20 degrees and 2 m is sufficient.
    initial = yaw_pose(2.6 + math.radians(20.0), (5.0, -4.5, 0.0))
    found = scanlock.register(source=source, target=target, initial=initial, method="sgc-ndt-d2d")
    assert found.ok, found.reason
    assert found.target_from_source.is_close(motion, translation=0.1, rotation=math.radians(0.3))


def test_a_drive_is_chained_from_scans_prepared_once():
    poses = [yaw_pose(0.1 * k, (1.5 * k, 0.2 * k, 0.0)) for k in range(5)]
    scans = [pose.inverse().apply(street(k)) for k, pose in enumerate(poses)]
    method = scanlock.METHODS["sgc-ndt-d2d"]

    prepared = [method.prepare(scanlock.PointCloud.from_array(scan)) for scan in scans]
    world_from_scan = scanlock.Pose.identity()
    for k in range(1, 5):
        world_from_scan = (
            world_from_scan
            @ method.align(prepared[k - 1], prepared[k], scanlock.Pose.identity()).pose
        )
    # Four steps with errors of at most 0.1 m and 0.3 degrees each.
    assert world_from_scan.is_close(poses[4], translation=0.4, rotation=math.radians(1.2))
