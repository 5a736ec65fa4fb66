"""Methods of Das et al. 2013, section VIII, with the settings of the paper."""

from dataclasses import replace

from scanlock.experiments.experiment import Contender
from scanlock.optimisation.solvers.criteria import ConvergenceCriteria
from scanlock.optimisation.solvers.newton import Newton
from scanlock.registration.methods.coarse_to_fine import PAPER_SCALES, CoarseToFine
from scanlock.registration.methods.gicp import Gicp
from scanlock.registration.methods.icp.correspondences import NearestNeighbourSearch
from scanlock.registration.methods.icp.distance_rejection import FixedRejection
from scanlock.registration.methods.icp.icp import Icp, IcpConvergenceCriteria
from scanlock.registration.methods.ndt import Ndt
from scanlock.registration.methods.sgc_ndt import SgcNdt

ICP, G_ICP, NDT = "ICP", "G-ICP", "NDT"
P2D, D2D = "SGC-NDT-P2D", "SGC-NDT-D2D"
P2D_PUBLISHED, D2D_PUBLISHED = f"{P2D}, one scale", f"{D2D}, one scale"

_TOLERANCE = 1e-6
"""Tolerance of the step norm [m]."""

_MAX_DISTANCE = 10.0
"""Maximum correspondence distance of the paper [m]."""

_VOXEL_SIZE = 0.25
"""Voxel size of the downsampling for ICP and G-ICP [m]; not stated in the paper."""

_MAX_ITERATIONS = 200
"""Maximum number of correspondence updates, never reached; not stated in the paper."""

_CORRESPONDENCES = (
    f"constant maximum correspondence distance of {_MAX_DISTANCE:g} m, as in the paper; both scans "
    f"downsampled to voxels of {_VOXEL_SIZE:g} m, not stated in the paper; ends at a step below "
    f"{_TOLERANCE:g} m, or after {_MAX_ITERATIONS} iterations"
)

_SGC = (
    "settings of scanlock: coarse to fine with a smoothing from 8 m to 0, where the paper has one "
    "scale; convergence tolerances of the paper; limits of the clusters of scanlock, not stated in "
    "the paper"
)
_ONE_SCALE = (
    "Algorithm 1 as published: one scale without smoothing; limits of the clusters and "
    "regularisation of the Newton step of scanlock"
)


def sgc_contenders() -> list[Contender]:
    """Return P2D and D2D of SGC-NDT, coarse to fine and as published."""
    solver = Newton(
        criteria=ConvergenceCriteria(gradient_tolerance=_TOLERANCE, step_tolerance=_TOLERANCE)
    )
    all_scales = CoarseToFine(solver=solver)
    one_scale = CoarseToFine(scales=PAPER_SCALES, solver=solver)
    p2d, d2d = SgcNdt(score="p2d", schedule=all_scales), SgcNdt(score="d2d", schedule=all_scales)
    return [
        Contender(name=P2D, method=p2d, remark=_SGC),
        Contender(name=D2D, method=d2d, remark=_SGC),
        Contender(name=P2D_PUBLISHED, method=replace(p2d, schedule=one_scale), remark=_ONE_SCALE),
        Contender(name=D2D_PUBLISHED, method=replace(d2d, schedule=one_scale), remark=_ONE_SCALE),
    ]


def icp_contender() -> Contender:
    """Return ICP with the settings of the paper."""
    method = Icp(
        rejection=FixedRejection(max_correspondence_distance=_MAX_DISTANCE),
        voxel_size=_VOXEL_SIZE,
        criteria=IcpConvergenceCriteria(step_tolerance=_TOLERANCE, max_iterations=_MAX_ITERATIONS),
    )
    return Contender(name=ICP, method=method, remark=f"point to point, {_CORRESPONDENCES}")


def gicp_contender() -> Contender:
    """Return G-ICP with the settings of the paper."""
    method = Gicp(
        search=NearestNeighbourSearch(max_correspondence_distances=(_MAX_DISTANCE,)),
        voxel_size=_VOXEL_SIZE,
        step_tolerance=_TOLERANCE,
        max_iterations=_MAX_ITERATIONS,
    )
    return Contender(name=G_ICP, method=method, remark=f"plane to plane, {_CORRESPONDENCES}")


def ndt_contender() -> Contender:
    """Return NDT with the settings of the paper, that of the Point Cloud Library."""
    return Contender(
        name=NDT,
        method=Ndt.das2013(),
        remark="cells of 3 m, as in the paper, each point in its own cell; all points; "
        "Magnusson's constants for an outlier ratio of 55 %; trust region instead of the line "
        "search of the library",
    )


def urban_contenders() -> list[Contender]:
    """Return the methods of the city experiment."""
    return [icp_contender(), gicp_contender(), ndt_contender(), *sgc_contenders()]


def forest_contenders() -> list[Contender]:
    """Return the methods of the forest experiment, the best two of the city."""
    return [gicp_contender(), *sgc_contenders()]
