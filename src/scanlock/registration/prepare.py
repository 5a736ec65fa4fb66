"""Scans made ready once, to be target of one registration and source of the next."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from numpy.typing import ArrayLike

from scanlock.clouds.point_cloud import PointCloud
from scanlock.errors import InvalidInput
from scanlock.interrupts import plain_interrupts
from scanlock.registration.methods.auto_scan import AutoScan
from scanlock.registration.methods.protocol import Method, Prepared
from scanlock.registration.registry import DEFAULT_METHOD, METHODS
from scanlock.registration.verification.features import (
    VerificationFeatures,
    extract_features,
    features_from_clusters,
)
from scanlock.segmentation.cluster_gaussians import MIN_GAUSSIANS, ClusterGaussians
from scanlock.timing import StageClock


@dataclass(frozen=True, slots=True, eq=False)
class PreparedScan:
    """A scan with all that does not depend on the other scan; `register` takes it as it is.

    Attributes
    ----------
    method : Method
        Settings that prepared it, and the only ones that can register it.
    name : str
        Key of `METHODS`, or the class of the settings.
    kept : Kept
        What the method keeps of the scan.
    evidence : Evidence or None
        What the verdict looks at; None where the scan cannot be registered.
    shortage : str
        Why the scan cannot be registered; empty when it can.
    timings : mapping of str to float [s]
        Wall time of each stage.
    """

    method: Method[Any]
    method_name: str
    data: Prepared
    features: VerificationFeatures | None
    insufficient: str
    timings: dict[str, float]

    @property
    def cloud(self) -> PointCloud:
        """The checked points of the whole scan."""
        return self.data.cloud

    @property
    def notes(self) -> tuple[str, ...]:
        """What was found on the way that a user may want to know."""
        found = () if self.features is None else self.features.notes
        notes = dict.fromkeys((*self.data.notes, *found))
        return (*_remarks(self.cloud), *notes)


_COARSE = 0.001
"""Rounding of coordinates [m] that is worth a word."""

_WIDEST, _NARROWEST = 2000.0, 0.1
"""Lidars see neither so far nor so little [m]: half of the points lie farther than one of these, or
nearer than the other."""


def _remarks(cloud: PointCloud) -> Iterator[str]:
    """Yield what is remarkable about the points themselves."""
    if cloud.dropped_count:
        yield f"{cloud.dropped_count} rows with NaN or Inf left out"
    if cloud.origin.any():
        yield f"computed about the origin {cloud.origin.tolist()} m"
    if cloud.rounding > _COARSE:
        yield (
            f"coordinates are rounded to {cloud.rounding:.3g} m, as single precision is so far "
            "from zero; read them in double precision, or subtract an offset before they are stored"
        )
    spread = cloud.radius
    if spread > _WIDEST:
        yield (
            f"half of the points lie more than {spread:.3g} m from their middle; where these are "
            "millimetres, multiply by 0.001"
        )
    if spread < _NARROWEST:
        yield (
            f"half of the points lie within {spread:.3g} m of their middle; coordinates must be "
            "metres"
        )


@plain_interrupts()
def prepare(
    scan: ArrayLike | PointCloud, *, method: str | Method[Any] = DEFAULT_METHOD, role: str = "scan"
) -> PreparedScan:
    """Return a scan made ready for any number of registrations.

    Parameters
    ----------
    scan : (n, 3+) array or PointCloud [m]
        As for `register`.
    method : str or Method
        As for `register`; a prepared scan is registered by the method that prepared it.
    role : str
        What to call the scan in errors.

    Raises
    ------
    InvalidInput
        A scan that is none, or an unknown method.
    """
    name, chosen = named_method(method)
    clock = StageClock()
    with clock.stage("check"):
        cloud = PointCloud.from_array(scan, role)
    kept: Prepared = chosen.prepare(cloud)
    clock.seconds.update(kept.timings)
    if kept.insufficient:
        return PreparedScan(chosen, name, kept, None, kept.insufficient, clock.seconds)
    with clock.stage("evidence"):
        if isinstance(kept, AutoScan):
            features = kept.features
        elif isinstance(kept, ClusterGaussians):
            features = features_from_clusters(kept)
        else:
            features = extract_features(cloud)
    parts = len(features.gaussians)
    insufficient = (
        "" if parts >= MIN_GAUSSIANS else f"holds {parts} parts, of {MIN_GAUSSIANS} needed"
    )
    return PreparedScan(chosen, name, kept, features, insufficient, clock.seconds)


def named_method(method: str | Method[Any]) -> tuple[str, Method[Any]]:
    """Return the name and the settings of a method given by either."""
    if not isinstance(method, str):
        return type(method).__name__, method
    if method not in METHODS:
        raise InvalidInput(f"method must be one of {', '.join(METHODS)}, got {method!r}")
    return method, METHODS[method]
