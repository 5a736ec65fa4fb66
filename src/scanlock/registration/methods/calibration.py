"""How many times larger the errors of poses are than the scatter within a pair of scans tells."""

from typing import Any

from scanlock.registration.methods.auto import Auto
from scanlock.registration.methods.gicp import Gicp
from scanlock.registration.methods.icp import Icp
from scanlock.registration.methods.mskm_ndt import MskmNdt
from scanlock.registration.methods.ndt import Ndt
from scanlock.registration.methods.ndt_d2d import NdtD2d
from scanlock.registration.methods.sgc_ndt import SgcNdt

_FINE_STAGE = 0.89
_CELLS_TO_CELLS = 0.86
_POINTS_TO_CELLS = 1.00
_SCALES = 1.06
_CLUSTERS = {"d2d": 1.16, "p2d": 1.11}
_SURFACES = {"closest": 1.10, "voxel": 1.11}
_PAIRS = {"point-to-plane": 1.86, "point-to-point": 4.42}


def covariance_factor(method: Any) -> float:
    """Return the factor of the deviations of a method; 1 for one that was never measured.

    The root of a sixth of the mean squared error, over the covariance that the scatter tells, of
    simulated streets, forests and rugged ground, 1 to 5 m apart;
    ``benchmarks/uncertainty/covariance.py --calibrate`` measures it. All parts of a scan are seen
    from one side and drawn by one pattern of rings, and what follows from that all units share.
    Closest points follow the rings of either scan: pairs of them err together most, and the
    distance from point to point, which they make small by shifting along a surface, most of all.
    """
    match method:
        case Auto():
            return covariance_factor(method.initial_method) if method.fine is None else _FINE_STAGE
        case NdtD2d():
            return _CELLS_TO_CELLS
        case Ndt():
            return _POINTS_TO_CELLS
        case MskmNdt():
            return _SCALES
        case SgcNdt():
            return _CLUSTERS[method.score]
        case Gicp():
            return _SURFACES[method.search]
        case Icp():
            return _PAIRS[method.estimation.residual]
        case _:
            return 1.0
