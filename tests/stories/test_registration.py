"""One user, two scans: from the first call to a pose that is used, or is not."""

import json
import math

import numpy as np

import scanlock
from reference.samples import street, yaw_pose


def test_two_scans_are_registered_and_the_pose_is_used():
    motion = yaw_pose(0.3, (3.0, -2.0, 0.1))
    reference = street(1).astype(np.float32)
    scene = motion.inverse().apply(street(2)).astype(np.float32)

    result = scanlock.register(source=scene, target=reference)

    assert result.ok, result.reason
    moved = result.target_from_source.apply(scene)
    metres, radians = result.target_from_source.distance(motion)
    # A tenth of a metre and a third of a degree: see the contracts of the methods.
    assert metres < 0.1
    assert math.degrees(radians) < 0.3
    # What stood in one place stands in one place again.
    here = scanlock.segment(reference)
    there = scanlock.segment(moved)
    assert abs(np.median(moved[there.is_ground, 2]) - np.median(reference[here.is_ground, 2])) < 0.1
    assert json.loads(result.to_json())["status"] == "ok"


def test_no_start_is_needed_whatever_the_heading():
    motion = yaw_pose(2.6, (14.0, -3.0, 0.0))
    reference, scene = street(1), motion.inverse().apply(street(2))

    found = scanlock.register(source=scene, target=reference)
    assert found.ok, found.reason
    assert found.target_from_source.is_close(motion, translation=0.05, rotation=math.radians(0.1))
    # And it says how it knows: one pose was found, and none that comes near it.
    assert found.candidates[0].proposed_by == "BEV correlation"
    assert found.runner_up_ratio < 0.5

    # A start that is wrong by anything does no harm.
    misled = scanlock.register(
        source=scene, target=reference, initial=yaw_pose(-1.0, (-20.0, 9.0, 0.0))
    )
    assert misled.ok, misled.reason
    assert misled.target_from_source.is_close(motion, translation=0.05, rotation=math.radians(0.1))


def test_a_failure_says_why_and_a_better_start_mends_it():
    motion = yaw_pose(2.6, (4.0, -3.0, 0.0))
    reference, scene = street(1), motion.inverse().apply(street(2))

    lost = scanlock.register(source=scene, target=reference, method="sgc-ndt-d2d")
    assert not lost.ok
    assert lost.status is scanlock.Status.UNVERIFIED
    assert "pose is likely wrong" in lost.reason

    # A compass that is 20 degrees off, and a position that is 2 m off, are enough.
    guess = yaw_pose(2.6 + math.radians(20.0), (5.0, -4.5, 0.0))
    found = scanlock.register(source=scene, target=reference, initial=guess, method="sgc-ndt-d2d")
    assert found.ok, found.reason
    assert found.target_from_source.is_close(motion, translation=0.1, rotation=math.radians(0.3))


def test_a_drive_of_scans_is_chained_with_each_prepared_once():
    poses = [yaw_pose(0.1 * k, (1.5 * k, 0.2 * k, 0.0)) for k in range(5)]
    scans = [pose.inverse().apply(street(k)) for k, pose in enumerate(poses)]
    method = scanlock.METHODS["sgc-ndt-d2d"]

    marks = [method.prepare(scanlock.PointCloud.from_array(scan)) for scan in scans]
    world_from_scan = scanlock.Pose.identity()
    for k in range(1, 5):
        world_from_scan = (
            world_from_scan @ method.align(marks[k - 1], marks[k], scanlock.Pose.identity()).pose
        )
    # Four steps of at most 0.1 m and 0.3 degrees; each turn swings what follows.
    assert world_from_scan.is_close(poses[4], translation=0.4, rotation=math.radians(1.2))
