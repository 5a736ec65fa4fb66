"""A guess at the pose between two scans, before anything is minimised."""

from dataclasses import dataclass

from scanlock.geometry.pose import Pose


@dataclass(frozen=True, slots=True)
class Hypothesis:
    """Where the source may lie.

    Attributes
    ----------
    pose : Pose
        target_from_source, between the local frames of the clouds.
    weight : float
        How strongly its maker believes in it; comparable within one maker only.
    maker : str
        What proposed it: "heading search", "cluster matching" or "prior".
    """

    pose: Pose
    weight: float
    maker: str
