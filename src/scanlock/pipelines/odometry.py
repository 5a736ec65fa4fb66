"""Scan-to-scan odometry: each scan of a sequence is registered to the one before it."""

from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, Literal

from numpy.typing import ArrayLike

from scanlock.clouds.point_cloud import PointCloud
from scanlock.errors import InvalidInput, require_count
from scanlock.geometry.pose import Pose
from scanlock.optimisation.objectives.constraints import DegreesOfFreedom
from scanlock.registration.methods.protocol import Method
from scanlock.registration.prepare import PreparedScan, prepared_as
from scanlock.registration.register import register
from scanlock.registration.registry import DEFAULT_METHOD
from scanlock.registration.result import RegistrationResult
from scanlock.registration.uncertainty.covariance_estimator import CovarianceEstimator
from scanlock.registration.uncertainty.pose_covariance import CovarianceMethod

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
    seconds : float [s]
        Wall time of preparing this scan and registering it.
    """

    cloud: PointCloud
    pose: Pose
    registration: RegistrationResult | None
    seconds: float

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
    covariance: bool | CovarianceMethod | CovarianceEstimator = False,
    initial_pose: Pose | None = None,
    initial_motion: Pose | None = None,
    threads: int = 1,
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
        ``"velocity"``, the registration after one that is not ok starts from the identity, and so
        does every registration of scans in map coordinates, which already have their places.
    dof : str
        Degrees of freedom of each registration, as for `register`.
    covariance : bool or str or CovarianceEstimator
        Whether and how to estimate the covariance of each motion, as for `register`; by default
        not, to save time.
    initial_pose : Pose, optional
        Pose of the first scan, to continue a trajectory; by default the identity.
    initial_motion : Pose, optional
        Motion from the first scan to the second, target from source, where it is known; by default
        the identity.
    threads : int
        Maximum number of threads. With two or more the next scan is read and prepared during a
        registration, so that three scans are held. The poses do not depend on it.

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
    require_count("threads", threads)
    previous: PreparedScan | None = None
    pose, motion = initial_pose or Pose.identity(), initial_motion or Pose.identity()
    for current in _prepared(scans, method, threads):
        result, seconds = None, sum(current.timings.values())
        if previous is not None:
            result = register(
                source=current,
                target=previous,
                initial=motion,
                dof=dof,
                covariance=covariance,
                threads=threads,
            )
            pose = pose @ result.target_from_source
            seconds += result.timings["total"]
            is_on_map = bool(current.cloud.origin.any())
            is_predictable = guess == "velocity" and result.ok and not is_on_map
            motion = result.target_from_source if is_predictable else Pose.identity()
        yield OdometryStep(cloud=current.cloud, pose=pose, registration=result, seconds=seconds)
        previous = current


def _prepared(
    scans: Iterable[ArrayLike | PointCloud], method: str | Method[Any], threads: int
) -> Iterator[PreparedScan]:
    """Yield the scans prepared; with several threads each is ready before it is asked for."""
    prepared = (
        prepared_as(f"scan {index}", scan, method, verify=True) for index, scan in enumerate(scans)
    )
    if threads == 1:
        yield from prepared
        return
    with ThreadPoolExecutor(1, thread_name_prefix="scanlock") as pool:
        coming = pool.submit(next, prepared, None)
        while (current := coming.result()) is not None:
            coming = pool.submit(next, prepared, None)
            yield current
