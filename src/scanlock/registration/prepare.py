"""Prepare a scan once, for any number of registrations as target or source."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from numpy.typing import ArrayLike

from scanlock.clouds.coordinates import HasPoints
from scanlock.clouds.point_cloud import PointCloud
from scanlock.interrupts import plain_interrupts
from scanlock.registration.methods.protocol import InsufficientData, Method, PreparationLog
from scanlock.registration.registry import DEFAULT_METHOD, named_method
from scanlock.registration.verification.features import (
    VerificationFeatures,
    extract_features,
    features_from_clusters,
)
from scanlock.threads import parallel_map
from scanlock.timing import StageClock

_COARSE = 0.001
"""Rounding of coordinates [m] from which a note is made."""

_MAX_RADIUS, _MIN_RADIUS = 2000.0, 0.1
"""Median distance of the points from their centre [m] that suggests units other than metres."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class PreparedScan:
    """A scan with everything that does not depend on the other scan.

    Attributes
    ----------
    method : Method
        The method that prepared it, and the only one that can register it.
    method_name : str
        Key of `METHODS`, or the class name of the settings.
    cloud : PointCloud
        The checked points of the whole scan.
    data : object or None
        The result of ``method.prepare``; None if the scan has too little to be registered.
    features : VerificationFeatures or None
        Features for the verification; None without verification or data, or if `unverifiable`.
    insufficient : str
        Why the scan cannot be registered; empty if it can.
    unverifiable : str
        Why no pose of the scan can be verified; empty if one can, or if that was not asked for.
    length_scale : float
        Length [m] of the units in which `data` and `features` are: 1, and more for sparse scans.
    timings : dict of str to float [s]
        Wall time of each stage.
    notes : tuple of str
        Facts about the scan that a user may want to know.
    """

    method: Method[Any]
    method_name: str
    cloud: PointCloud
    data: Any
    features: VerificationFeatures | None
    insufficient: str
    timings: dict[str, float]
    notes: tuple[str, ...]
    unverifiable: str = ""
    length_scale: float = 1.0

    def __repr__(self) -> str:
        left_out = f", insufficient: {self.insufficient}" if self.insufficient else ""
        return f"PreparedScan({self.method_name}, {len(self.cloud):,} points{left_out})"


Scan = ArrayLike | HasPoints | PointCloud | PreparedScan
"""A scan as `register` takes it."""


@plain_interrupts()
def prepare(
    scan: ArrayLike | HasPoints | PointCloud,
    *,
    method: str | Method[Any] = DEFAULT_METHOD,
    verify: bool = True,
) -> PreparedScan:
    """Prepare a scan for any number of registrations.

    Parameters
    ----------
    scan : (n, 3+) array or PointCloud [m]
        As for `register`.
    method : str or Method
        As for `register`. A prepared scan is registered by the method that prepared it.
    verify : bool
        Whether to extract the features for the verification.

    Returns
    -------
    PreparedScan
        The data of the method, the features for the verification, notes and timings.

    Raises
    ------
    InvalidInput
        A scan of the wrong shape or type or without a finite point, or an unknown method.
    """
    return prepared_as("scan", scan, method, verify)


def prepared_as(
    role: str,
    scan: ArrayLike | HasPoints | PointCloud,
    method: str | Method[Any],
    verify: bool,
    min_length_scale: float = 1.0,
) -> PreparedScan:
    """Prepare a scan as `prepare` does; errors name it by its role.

    `min_length_scale` is that of the other scan, for a pair takes the larger one of its scans.
    """
    name, chosen = named_method(method)
    log = PreparationLog()
    with log.stage("check"):
        cloud = PointCloud.from_array(scan, role)
        scaled = cloud.scaled(max(cloud.length_scale, min_length_scale))
    data, features, insufficient = None, None, ""
    try:
        data = chosen.prepare(scaled, log)
        if verify:
            with log.stage("features"):
                features = _features(scaled, log)
    except InsufficientData as error:
        insufficient = str(error)
    found = () if features is None else features.notes
    unverifiable = "" if features is None else features.insufficient_reason
    return PreparedScan(
        method=chosen,
        method_name=name,
        cloud=cloud,
        data=data,
        features=None if unverifiable else features,
        insufficient=insufficient,
        unverifiable=unverifiable,
        length_scale=scaled.scale,
        timings=log.seconds,
        notes=(*_remarks(cloud), *_scale_remark(scaled), *dict.fromkeys((*log.notes, *found))),
    )


def prepared_pair(
    target: Scan, source: Scan, method: Method[Any], verify: bool, clock: StageClock
) -> tuple[PreparedScan, PreparedScan]:
    """Return two scans prepared at one length scale, the larger one; add the times of the stages.

    Scans of one sensor mostly have the same scale. A scan that is prepared for it is not prepared
    again.
    """
    scans, found, scale = [target, source], list[PreparedScan](), 1.0
    for _ in range(2):
        found = parallel_map(
            lambda pair, scale=scale: _prepared(*pair, method, verify, scale),
            list(zip(scans, ("target", "source"), strict=True)),
        )
        for given, scan in zip(scans, found, strict=True):
            for stage, seconds in () if scan is given else scan.timings.items():
                clock.seconds[stage] = clock.seconds.get(stage, 0.0) + seconds
        scans, scale = list[Scan](found), max(one.length_scale for one in found)
    return found[0], found[1]


def _prepared(
    scan: Scan, role: str, method: Method[Any], verify: bool, min_length_scale: float
) -> PreparedScan:
    if not isinstance(scan, PreparedScan):
        return prepared_as(role, scan, method, verify, min_length_scale)
    lacks_features = scan.features is None and not (scan.insufficient or scan.unverifiable)
    if (verify and lacks_features) or scan.length_scale < min_length_scale:
        return prepared_as(role, scan.cloud, method, verify, min_length_scale)
    return scan


def _features(cloud: PointCloud, log: PreparationLog) -> VerificationFeatures:
    """Extract the features for the verification, from the clusters of the method if it has some."""
    if log.features is not None:
        return log.features
    if log.clusters is not None:
        return features_from_clusters(log.clusters)
    return extract_features(cloud)


def _scale_remark(cloud: PointCloud) -> Iterator[str]:
    if cloud.scale > 1.0:
        yield f"sparse: all lengths of the settings are multiplied by {cloud.scale:g}"


def _remarks(cloud: PointCloud) -> Iterator[str]:
    """Yield notes about the points themselves."""
    if cloud.dropped_count:
        yield f"{cloud.dropped_count} rows with NaN or Inf left out"
    if cloud.origin.any():
        yield f"computed about the origin {cloud.origin.tolist()} m"
    if cloud.rounding > _COARSE:
        yield (
            f"coordinates are rounded to {cloud.rounding:.3g} m, as in single precision so far "
            "from zero; read them in double precision, or subtract an offset before storing them"
        )
    radius = cloud.radius
    if radius > _MAX_RADIUS:
        yield (
            f"half of the points lie more than {radius:.3g} m from their centre; if these are "
            "millimetres, multiply by 0.001"
        )
    if radius < _MIN_RADIUS:
        yield (
            f"half of the points lie within {radius:.3g} m of their centre; coordinates must be "
            "metres"
        )
