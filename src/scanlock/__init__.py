"""Lock 3D lidar scans together.

``scanlock.register(source=scene, target=reference)`` returns the pose between two scans and
whether to trust it; ``scanlock.segment(points)`` returns the ground and the clusters of one.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from scanlock.clouds.point_cloud import PointCloud as PointCloud
    from scanlock.errors import InvalidInput as InvalidInput
    from scanlock.errors import ScanlockError as ScanlockError
    from scanlock.geometry.pose import Pose as Pose
    from scanlock.optimisation.objectives.constraints import PosePrior as PosePrior
    from scanlock.registration.methods.sgc_ndt import SgcNdt as SgcNdt
    from scanlock.registration.prepare import PreparedScan as PreparedScan
    from scanlock.registration.prepare import prepare as prepare
    from scanlock.registration.register import register as register
    from scanlock.registration.registry import METHODS as METHODS
    from scanlock.registration.result import RegistrationResult as RegistrationResult
    from scanlock.registration.uncertainty.estimators import (
        CovarianceEstimator as CovarianceEstimator,
    )
    from scanlock.registration.uncertainty.pose_covariance import PoseCovariance as PoseCovariance
    from scanlock.registration.verification.status import Status as Status
    from scanlock.registration.warm_up import warm_up as warm_up
    from scanlock.segmentation.clusters import ClusterFinder as ClusterFinder
    from scanlock.segmentation.ground.finder import GroundFinder as GroundFinder
    from scanlock.segmentation.segmentation import Segmentation as Segmentation
    from scanlock.segmentation.segmentation import Segmenter as Segmenter
    from scanlock.segmentation.segmentation import segment as segment

__version__ = "0.1.0.dev0"

_HOMES = {
    "METHODS": "scanlock.registration.registry",
    "ClusterFinder": "scanlock.segmentation.clusters",
    "GroundFinder": "scanlock.segmentation.ground.finder",
    "InvalidInput": "scanlock.errors",
    "PointCloud": "scanlock.clouds.point_cloud",
    "Pose": "scanlock.geometry.pose",
    "PoseCovariance": "scanlock.registration.uncertainty.pose_covariance",
    "PosePrior": "scanlock.optimisation.objectives.constraints",
    "PreparedScan": "scanlock.registration.prepare",
    "RegistrationResult": "scanlock.registration.result",
    "ScanlockError": "scanlock.errors",
    "Segmentation": "scanlock.segmentation.segmentation",
    "Segmenter": "scanlock.segmentation.segmentation",
    "SgcNdt": "scanlock.registration.methods.sgc_ndt",
    "Status": "scanlock.registration.result",
    "CovarianceEstimator": "scanlock.registration.uncertainty.estimators",
    "prepare": "scanlock.registration.prepare",
    "register": "scanlock.registration.register",
    "segment": "scanlock.segmentation.segmentation",
    "warm_up": "scanlock.registration.warm_up",
}

__all__ = [*_HOMES]  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(name: str) -> object:
    # Numba and SciPy take over a second to import, so each name is fetched on first use and
    # the command line can print its help at once.
    if name not in _HOMES:
        raise AttributeError(f"module 'scanlock' has no attribute {name!r}")
    value = getattr(import_module(_HOMES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *_HOMES})
