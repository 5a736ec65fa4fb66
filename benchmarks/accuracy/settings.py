"""Methods with one setting changed at a time, on pairs of a city drive from the identity.

    python -m benchmarks.accuracy.settings --data FOLDER [--only TEXT]

All pairs ten and twenty scans apart. A pair is solved within 0.3 m and 1 degree of its reference.
Medians are over the solved pairs. Evaluations of the objective and CPU time of a call are means
over the pairs ten apart.
"""

import time
from dataclasses import replace

import numpy as np

from benchmarks._common.arguments import make_parser
from benchmarks._common.contenders import is_solved, pose_error
from benchmarks._common.real_scans import RealPair, kitti_drive
from benchmarks._common.results import Results
from scanlock.optimisation.solvers.bfgs import Bfgs
from scanlock.optimisation.solvers.levenberg_marquardt import LevenbergMarquardt
from scanlock.optimisation.solvers.line_search import Armijo, StrongWolfe
from scanlock.optimisation.solvers.line_search_newton import LineSearchNewton
from scanlock.optimisation.solvers.more_thuente import MoreThuente
from scanlock.registration.methods.coarse_to_fine import CoarseToFine
from scanlock.registration.methods.gicp import Gicp
from scanlock.registration.methods.icp.correspondences import NearestNeighbourSearch, VoxelSearch
from scanlock.registration.methods.icp.distance_rejection import FixedRejection, TrimmedRejection
from scanlock.registration.methods.icp.icp import Icp
from scanlock.registration.methods.icp.transform_estimation import TransformEstimation
from scanlock.registration.methods.mskm_ndt import MskmNdt
from scanlock.registration.methods.ndt import Ndt
from scanlock.registration.methods.ndt_d2d import NdtD2d
from scanlock.registration.methods.protocol import Method
from scanlock.registration.methods.sgc_ndt import SgcNdt
from scanlock.registration.register import register
from scanlock.registration.registry import METHODS

_PLANES = TransformEstimation(algorithm="gauss-newton", residual="point-to-plane")

SOLVERS = {
    "line-search Newton, Moré-Thuente": LineSearchNewton(line_search=MoreThuente()),
    "line-search Newton, strong Wolfe": LineSearchNewton(line_search=StrongWolfe()),
    "line-search Newton, Armijo": LineSearchNewton(line_search=Armijo()),
    "Levenberg-Marquardt": LevenbergMarquardt(),
    "Gauss-Newton": LevenbergMarquardt(first_damping=0.0),
    "BFGS, Moré-Thuente": Bfgs(line_search=MoreThuente()),
    "BFGS, strong Wolfe": Bfgs(line_search=StrongWolfe()),
    "BFGS, Armijo": Bfgs(line_search=Armijo()),
}

VARIANTS: dict[str, Method] = {
    **{name: METHODS[name] for name in METHODS},
    **{
        f"gicp, max. distance {metres:g} m": Gicp(
            search=NearestNeighbourSearch(max_correspondence_distances=(metres,))
        )
        for metres in (1.0, 2.5, 5.0, 10.0)
    },
    "gicp, 20 neighbours": Gicp(neighbours=20),
    "gicp, ellipsoids": Gicp(shape="ellipsoid"),
    "vgicp, voxels of 1 m": Gicp(search=VoxelSearch(voxel_sizes=(1.0,))),
    "ndt, das2013: 3 m, own cell, all points": Ndt.das2013(),
    "ndt, 3 m, near cells, all points": Ndt(cell_sizes=(3.0,), voxel_size=0.0),
    "ndt, 3 m, own cell": Ndt(cell_sizes=(3.0,), association="own-cell"),
    "ndt, 3 m, near cells": Ndt(cell_sizes=(3.0,)),
    "ndt, 3 m, trilinear": Ndt(cell_sizes=(3.0,), association="trilinear"),
    "ndt, 3 m, all cells in range": Ndt(cell_sizes=(3.0,), association="all"),
    "ndt-d2d, stoyanov2012: from 2 m": NdtD2d.stoyanov2012(),
    "mskm-ndt, obstacles only": MskmNdt(points="obstacles"),
    "mskm-ndt, d2d": MskmNdt(score="d2d"),
    "icp, madhavan2003, downsampled, k-d tree": replace(
        Icp.madhavan2003(), search="k-d tree", voxel_size=0.5
    ),
    "icp, max. distance 10 m": Icp(rejection=FixedRejection(max_correspondence_distance=10.0)),
    "icp, trimmed to 70 %": Icp(rejection=TrimmedRejection(inlier_ratio=0.7)),
    "icp, point to plane": Icp(estimation=_PLANES),
    **{
        f"sgc-ndt-d2d, {name}": SgcNdt(schedule=CoarseToFine(solver=solver))
        for name, solver in SOLVERS.items()
    },
}


def cell(method: Method, pairs: list[RealPair]) -> tuple[str, float, float]:
    """Return solved pairs with median errors, and evaluations and CPU seconds per call."""
    found: list[tuple[float, float]] = []
    evaluations, seconds = 0, 0.0
    for pair in pairs:
        target, source = pair.load_target(), pair.load_source()
        begin = time.process_time()
        result = register(source=source, target=target, method=method)
        seconds += time.process_time() - begin
        evaluations += result.evaluations
        found.append(pose_error(result.target_from_source, pair.truth))
    solved = [error for error in found if is_solved(error)]
    text = f"{len(solved)} / {len(pairs)}"
    if solved:
        metres, degrees = np.median(solved, axis=0)
        text += f", {100 * metres:.1f} cm, {degrees:.3f}°"
    return text, evaluations / len(pairs), seconds / len(pairs)


def main() -> None:
    parser = make_parser(__doc__, data=True)
    parser.add_argument("--only", default="", help="only variants with this text in the name")
    arguments = parser.parse_args()
    groups = [list(kitti_drive(arguments.data, step)) for step in (10, 20)]
    results = Results(arguments.json)
    results.print_machine()

    def row(name: str, method: Method) -> list[str]:
        register(
            source=groups[0][0].load_source(), target=groups[0][0].load_target(), method=method
        )
        cells = [cell(method, pairs) for pairs in groups]
        _, evaluations, seconds = cells[0]
        return [name, *(text for text, *_ in cells), f"{evaluations:.0f}", f"{1e3 * seconds:.0f}"]

    results.add_table(
        ("settings", "ten apart", "twenty apart", "evaluations", "CPU ms"),
        (row(name, method) for name, method in VARIANTS.items() if arguments.only in name),
        title="settings",
    )


if __name__ == "__main__":
    main()
