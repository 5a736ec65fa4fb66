"""A smooth drive and an estimate of it with drift, by formula; the input of other tools as well."""

import numpy as np

from scanlock.geometry.pose import Pose


def wavy_drive(count=120):
    """Return ascending times [s] and poses: a drive of about 100 m, with hills and curves."""
    t = np.arange(count)
    times = 1000.0 + 0.1 * t + 0.01 * np.sin(0.9 * t)
    poses = [Pose.identity()]
    for k in range(1, count):
        step = [0.9 + 0.3 * np.sin(0.11 * k), 0.02 * np.cos(0.3 * k), 0.03 * np.sin(0.17 * k)]
        turn = [0.004 * np.sin(0.5 * k), 0.006 * np.cos(0.23 * k), 0.05 * np.sin(0.07 * k)]
        poses.append(poses[-1] @ Pose.from_step(np.array([*step, *turn])))
    return times, poses


def drifting(poses):
    """Return an estimate of the poses in another world, 2 % too long, with errors of motion."""
    world = Pose.from_step(np.array([5.0, -3.0, 1.0, 0.1, -0.2, 0.7]))
    found = [world]
    for k in range(1, len(poses)):
        motion = poses[k - 1].inverse() @ poses[k]
        slip = [0.02 * np.sin(1.3 * k), 0.015 * np.cos(2.1 * k), 0.01 * np.sin(0.7 * k)]
        twist = [0.001 * np.cos(1.7 * k), 0.0015 * np.sin(0.4 * k), 0.002 * np.cos(0.9 * k)]
        longer = Pose(motion.rotation, 1.02 * motion.translation)
        found.append(found[-1] @ longer @ Pose.from_step(np.array([*slip, *twist])))
    return found
