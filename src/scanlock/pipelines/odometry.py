"""Scan-to-scan odometry: each scan of a sequence is registered to the one before it."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any, Literal

from numpy.typing import ArrayLike

from scanlock.clouds.point_cloud import PointCloud
from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.optimisation.objectives.constraints import DegreesOfFreedom
from scanlock.registration.methods.protocol import Method
from scanlock.registration.prepare import PreparedScan, prepared_as
from scanlock.registration.register import register
from scanlock.registration.registry import DEFAULT_METHOD
from scanlock.registration.result import RegistrationResult

Guess = Literal["identity", "velocity"]
"""Initial pose of each registration: the identity, as in Das et al. 2013, or the last motion
(constant-velocity model)."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class OdometryStep:
    """One scan of a sequence with its pose.

    Attributes
    ----------
    cloud : PointCloud
        The checked points of the scan.
    pose : Pose
        ``first_from_scan``, in the coordinates of the input.
    registration : RegistrationResult or None
        Registration of this scan to the previous one; None for the first scan.
    """

    cloud: PointCloud
    pose: Pose
    registration: RegistrationResult | None

    @property
    def ok(self) -> bool:
        """Whether the registration of this scan is ok; True for the first scan."""
        return self.registration is None or self.registration.ok


def odometry(
    scans: Iterable[ArrayLike | PointCloud],
    *,
    method: str | Method[Any] = DEFAULT_METHOD,
    guess: Guess = "velocity",
    dof: DegreesOfFreedom = "xyz+rpy",
) -> Iterator[OdometryStep]:
    """Estimate the pose of each scan in the frame of the first, by registering it to the previous.

    Each scan is prepared once, and its step is yielded before the next scan is read. A motion
    whose registration is not ok still enters the trajectory: all later poses depend on it. Check
    `OdometryStep.ok`, and stop iterating to end the trajectory before such a motion.

    Parameters
    ----------
    scans : iterable of (n, 3+) arrays or PointCloud [m]
        In temporal order; at most two scans are held at a time.
    method : str or Method
        As for `register`.
    guess : {"velocity", "identity"}
        Initial pose of each registration: the previous motion, or the identity. With
        ``"velocity"``, the registration after one that is not ok starts from the identity.
    dof : str
        Degrees of freedom of each registration, as for `register`.

    Yields
    ------
    OdometryStep

    Raises
    ------
    InvalidInput
        An invalid scan, an unknown method, or an unknown guess.
    """
    if guess not in ("identity", "velocity"):
        raise InvalidInput(f"guess must be 'identity' or 'velocity', got {guess!r}")
    previous: PreparedScan | None = None
    pose, motion = Pose.identity(), Pose.identity()
    for index, scan in enumerate(scans):
        current = prepared_as(f"scan {index}", scan, method, verify=True)
        if previous is None:
            result = None
        else:
            result = register(source=current, target=previous, initial=motion, dof=dof)
            pose = pose @ result.target_from_source
            is_predictable = guess == "velocity" and result.ok
            motion = result.target_from_source if is_predictable else Pose.identity()
        yield OdometryStep(cloud=current.cloud, pose=pose, registration=result)
        previous = current
