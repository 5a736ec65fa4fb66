"""Table 1 of Madhavan and Messina 2003: pairs, starts and numbers of its rows."""

import math
from dataclasses import dataclass

import numpy as np

from scanlock.experiments.ladar.series import CREEPING, PARKED, LadarDrive
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import exp_rotation
from scanlock.pipelines.starts import Displaced

AS_TAKEN = "as taken"
SHIFTED = "1 m along each axis"
SHIFTED_AND_TURNED = "3 m along each axis, 10 degrees"

STARTS = Displaced(
    motions={
        AS_TAKEN: Pose.identity(),
        SHIFTED: Pose(np.eye(3), np.full(3, 1.0)),
        SHIFTED_AND_TURNED: Pose(
            exp_rotation(np.array([0.0, 0.0, math.radians(10.0)])), np.full(3, 3.0)
        ),
    }
)
"""Motions of range image D. The rotation axis is not stated in the paper; here it is vertical."""


@dataclass(frozen=True, kw_only=True, slots=True)
class PaperRow:
    """Row of Table 1."""

    name: str
    """Number of the row."""

    drive: LadarDrive
    """Simulated drive that represents the pair."""

    start: str
    """Motion of D, one of `STARTS`."""

    distance: float
    """Mean distance after registration in the paper [m]."""

    iterations: int
    """Number of iterations in the paper."""

    def __str__(self) -> str:
        return f"{self.name} ({self.drive}, {self.start})"


ROWS = (
    PaperRow(name="#1", drive=CREEPING, start=AS_TAKEN, distance=0.0577, iterations=6),
    PaperRow(name="#2", drive=PARKED, start=AS_TAKEN, distance=0.0464, iterations=3),
    PaperRow(name="#3", drive=PARKED, start=SHIFTED, distance=0.0464, iterations=38),
    PaperRow(name="#4", drive=CREEPING, start=SHIFTED_AND_TURNED, distance=0.1166, iterations=83),
)
