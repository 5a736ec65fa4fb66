"""Outcome of a registration."""

import enum


class Status(enum.StrEnum):
    """Outcome of a registration; only a pose with `OK` may be used without inspection."""

    OK = "ok"
    """The solver converged, and the pose passed every check of the verification."""

    DEGENERATE = "degenerate"
    """The overlapping geometry does not constrain some direction; the pose may be off in it."""

    AMBIGUOUS = "ambiguous"
    """Another pose scores nearly as well."""

    LOW_OVERLAP = "low_overlap"
    """The scans overlap too little to decide whether the pose is correct."""

    UNVERIFIED = "unverified"
    """The verification was not asked for, or its probability is below the threshold."""

    INACCURATE = "inaccurate"
    """The place is right, but point-to-plane refinement would still move the pose too far."""

    NOT_CONVERGED = "not_converged"
    """The solver reached its iteration limit."""

    NO_CORRESPONDENCES = "no_correspondences"
    """The scans have no correspondences, or one has too few Gaussians or points; the pose is the
    initial one."""
