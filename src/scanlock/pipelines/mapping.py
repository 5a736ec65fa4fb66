"""A sequence of scans registered one to the next: its trajectory, scan by scan."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any, Literal

from numpy.typing import ArrayLike

from scanlock.clouds.point_cloud import PointCloud
from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.optimisation.objectives.constraints import DegreesOfFreedom
from scanlock.registration.methods.protocol import Method
from scanlock.registration.prepare import PreparedScan, prepare
from scanlock.registration.register import register
from scanlock.registration.registry import DEFAULT_METHOD
from scanlock.registration.result import RegistrationResult

Guess = Literal["identity", "velocity"]
"""Where each registration begins: at no motion, as in Das et al. 2013, or at the last motion."""


@dataclass(frozen=True, slots=True, eq=False)
class MappedScan:
    """One scan of a sequence, laid into the frame of the first.

    Attributes
    ----------
    cloud : PointCloud
        Its checked points.
    pose : Pose
        ``first_from_scan``, in the frames that the caller gave.
    registration : Registration or None
        Of this scan to the one before; None for the first.
    """

    cloud: PointCloud
    pose: Pose
    registration: RegistrationResult | None

    @property
    def ok(self) -> bool:
        """Whether the motion to this scan can be used unseen."""
        return self.registration is None or self.registration.ok


def mapped_scans(
    scans: Iterable[ArrayLike | PointCloud],
    *,
    method: str | Method[Any] = DEFAULT_METHOD,
    guess: Guess = "identity",
    dof: DegreesOfFreedom = "xyz+rpy",
) -> Iterator[MappedScan]:
    """Yield each scan with its pose in the frame of the first, as soon as it is known.

    Each scan is prepared once and registered to the one before. A motion whose registration is
    not ok enters the chain as the best pose seen, or as the guess where nothing met, and the
    scan says so: everything after it stands on that motion. Who wants none of that takes no more
    scans after the first that is not ok.

    Parameters
    ----------
    scans : iterable of (n, 3+) arrays or PointCloud [m]
        In their order; none is kept longer than its successor takes.
    method : str or Method
        As for `register`.
    guess : str
        Where each registration begins. The last motion serves drives well; after a pair that is
        not ok the next one begins at no motion again.
    dof : str
        What may change of that beginning, as for `register`.

    Raises
    ------
    InvalidInput
        A scan that is none, an unknown method, or an unknown guess.
    """
    if guess not in ("identity", "velocity"):
        raise InvalidInput(f"guess must be 'identity' or 'velocity', got {guess!r}")
    before: PreparedScan | None = None
    pose, motion = Pose.identity(), Pose.identity()
    for index, scan in enumerate(scans):
        ready = prepare(scan, method=method, role=f"scan {index}")
        if before is None:
            found = None
        else:
            found = register(source=ready, target=before, initial=motion, dof=dof)
            pose = pose @ found.target_from_source
            is_kept = guess == "velocity" and found.ok
            motion = found.target_from_source if is_kept else Pose.identity()
        yield MappedScan(ready.cloud, pose, found)
        before = ready
