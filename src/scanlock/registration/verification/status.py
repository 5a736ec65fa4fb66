"""How a registration ended."""

import enum


class Status(enum.Enum):
    """How a registration ended; only `OK` is a pose to use unseen."""

    OK = "ok"
    """The solver converged, and the scans agree at the pose as they do at right ones."""

    DEGENERATE = "degenerate"
    """The scans look alike when moved along some direction; the pose may be wrong along it."""

    AMBIGUOUS = "ambiguous"
    """Another pose, not near the one chosen, agrees nearly as well."""

    LOW_OVERLAP = "low_overlap"
    """Too little of the scans agrees at the pose: it is likely wrong, or they share too little."""

    UNVERIFIED = "unverified"
    """The verification does not confirm the pose."""

    NOT_CONVERGED = "not_converged"
    """The iteration limit came first, or the pose is not at rest on the surfaces that both show."""

    NO_CORRESPONDENCES = "no_correspondences"
    """Nothing of the two scans meets, or one holds too few parts; the initial pose, untouched."""
