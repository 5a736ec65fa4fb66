"""A small series of scans with exact poses, and study records."""

import numpy as np

from reference.samples import street, yaw_pose
from scanlock import METHODS, Pose
from scanlock.experiments.experiment import Contender
from scanlock.experiments.series import ScanSeries
from scanlock.pipelines.study import StudyRecord, StudyTask

STEP = yaw_pose(0.05, (0.8, 0.1, 0.0))
METHOD = METHODS["sgc-ndt-d2d"]


def toy_series():
    """Four scans of one street, each a step further."""
    poses = [Pose.identity()]
    for _ in range(3):
        poses.append(poses[-1] @ STEP)
    names = tuple(f"scan{number}" for number in range(4))
    scans = {
        name: pose.inverse().apply(street(seed))
        for seed, (name, pose) in enumerate(zip(names, poses, strict=True), start=1)
    }
    return ScanSeries(
        title="four toy scans",
        origin="tests",
        key="toy",
        names=names,
        times=np.arange(4.0),
        load=scans.__getitem__,
        truth=tuple(poses),
        truth_kind="exact",
    )


def contender(name, method=METHOD):
    return Contender(name=name, method=method, remark="as it is")


def record_of(pair, method, error=(0.0, 0.0), pose=STEP, status="ok"):
    return StudyRecord(
        task=StudyTask(pair.name, method, "identity"),
        status=status,
        reason="because",
        start=Pose.identity(),
        pose=pose,
        translation_error=error[0],
        rotation_error=error[1],
    )
