"""The one list of methods; the command line, the studies and the contract tests read it."""

from typing import Any

from scanlock.registration.methods.auto import Auto
from scanlock.registration.methods.gicp import Gicp
from scanlock.registration.methods.icp import Icp
from scanlock.registration.methods.icp_annealing import AnnealedStart
from scanlock.registration.methods.mskm_ndt import MskmNdt
from scanlock.registration.methods.ndt import Ndt
from scanlock.registration.methods.ndt_d2d import NdtD2d
from scanlock.registration.methods.protocol import Method
from scanlock.registration.methods.sgc_ndt import SgcNdt

METHODS: dict[str, Method[Any]] = {
    "auto": Auto(),
    "sgc-ndt-d2d": SgcNdt(score="d2d"),
    "sgc-ndt-p2d": SgcNdt(score="p2d"),
    "gicp": Gicp(),
    "vgicp": Gicp(search="voxel"),
    "icp": Icp(),
    "icp-annealed": Icp(annealing=AnnealedStart()),
    "ndt": Ndt(),
    "ndt-d2d": NdtD2d(),
    "mskm-ndt": MskmNdt(),
}
"""Each method by name, with its default settings."""

DEFAULT_METHOD = "auto"
