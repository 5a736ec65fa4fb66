"""The methods of Das et al. 2013, section VIII, with the settings that the paper states."""

from dataclasses import replace

from scanlock.experiments.experiment import Contender
from scanlock.optimisation.solvers.criteria import ConvergenceCriteria
from scanlock.optimisation.solvers.newton import Newton
from scanlock.registration.methods.coarse_to_fine import PAPER_SCALES, CoarseToFine
from scanlock.registration.methods.correspondences import NearestNeighbourSearch
from scanlock.registration.methods.gicp import Gicp
from scanlock.registration.methods.icp import Icp, IcpConvergenceCriteria
from scanlock.registration.methods.ndt import Ndt
from scanlock.registration.methods.rejection import FixedRejection
from scanlock.registration.methods.sgc_ndt import SgcNdt

ICP, G_ICP, NDT = "ICP", "G-ICP", "NDT"
P2D, D2D = "SGC-NDT-P2D", "SGC-NDT-D2D"
P2D_PRINTED, D2D_PRINTED = f"{P2D}, one scale", f"{D2D}, one scale"

_TOLERANCE = 1e-6
"""Where optimisations end: the norm of the step [m]."""

_FARTHEST = 10.0
"""Points farther apart are no pair in the paper [m]."""

_SPACING = 0.25
"""Voxels that scans are thinned to for pairing points [m]: ours, the paper does not speak of it."""

_ROUNDS = 200
"""How often points are paired at most: ours, and more than any pair needs to end by itself."""

_PAIRING = (
    f"pairs up to {_FARTHEST:g} m apart from first to last, as the paper says; either scan thinned "
    f"to voxels of {_SPACING:g} m, of which it says nothing; ends when new pairs move the pose by "
    f"less than {_TOLERANCE:g} m, or after {_ROUNDS} rounds of them"
)

_SGC = (
    "scanlock's own settings: every scale of blur from 8 m down to none, where the paper has a "
    "single one; the stopping tolerances are the paper's, the limits of the clusters ours, for the "
    "paper states none"
)
_ONE_SCALE = (
    "Algorithm 1 as it is printed: one scale, no blur; the limits of the clusters are ours, and "
    "so is the mended Newton step"
)


def sgc_contenders() -> list[Contender]:
    """Return SGC-NDT both ways, as scanlock has it and as it is printed."""
    solver = Newton(
        criteria=ConvergenceCriteria(gradient_tolerance=_TOLERANCE, step_tolerance=_TOLERANCE)
    )
    all_scales = CoarseToFine(solver=solver)
    one_scale = CoarseToFine(scales=PAPER_SCALES, solver=solver)
    p2d, d2d = SgcNdt(score="p2d", schedule=all_scales), SgcNdt(score="d2d", schedule=all_scales)
    return [
        Contender(name=P2D, method=p2d, remark=_SGC),
        Contender(name=D2D, method=d2d, remark=_SGC),
        Contender(name=P2D_PRINTED, method=replace(p2d, schedule=one_scale), remark=_ONE_SCALE),
        Contender(name=D2D_PRINTED, method=replace(d2d, schedule=one_scale), remark=_ONE_SCALE),
    ]


def icp_contender() -> Contender:
    """Return ICP as the paper has it."""
    method = Icp(
        rejection=FixedRejection(max_correspondence_distance=_FARTHEST),
        voxel_size=_SPACING,
        criteria=IcpConvergenceCriteria(step_tolerance=_TOLERANCE, max_iterations=_ROUNDS),
    )
    return Contender(name=ICP, method=method, remark=f"point to point, {_PAIRING}")


def gicp_contender() -> Contender:
    """Return G-ICP as the paper has it."""
    method = Gicp(
        search=NearestNeighbourSearch(max_correspondence_distances=(_FARTHEST,)),
        voxel_size=_SPACING,
        step_tolerance=_TOLERANCE,
        max_iterations=_ROUNDS,
    )
    return Contender(name=G_ICP, method=method, remark=f"plane to plane, {_PAIRING}")


def ndt_contender() -> Contender:
    """Return NDT as the paper has it: the Point Cloud Library's, cells of 3 m."""
    return Contender(
        name=NDT,
        method=Ndt.das2013(),
        remark="cells of 3 m, as the paper says, and each point in its own; all points; "
        "Magnusson's constants for 55 % of outliers; a trust region where the library has a line "
        "search",
    )


def urban_contenders() -> list[Contender]:
    """Return the methods of the city."""
    return [icp_contender(), gicp_contender(), ndt_contender(), *sgc_contenders()]


def forest_contenders() -> list[Contender]:
    """Return the methods of the forest: the best two of the city."""
    return [gicp_contender(), *sgc_contenders()]
