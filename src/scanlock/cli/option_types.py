"""The types of options that several commands have.

The names repeat the keys of the dictionaries they come from, because importing those would make
help wait for Numba; a test holds the two together.
"""

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

MethodName = Literal[
    "auto",
    "sgc-ndt-d2d",
    "sgc-ndt-p2d",
    "gicp",
    "vgicp",
    "icp",
    "icp-annealed",
    "ndt",
    "ndt-d2d",
    "mskm-ndt",
]
DofName = Literal["xyz+rpy", "xyz+yaw", "xy+yaw"]
CovarianceName = Literal["sandwich", "hessian", "sampled"]
FormatName = Literal["bin", "npy", "npz", "pcd", "ply", "txt", "las"]
SceneName = Literal["street", "forest", "rugged"]
SensorName = Literal["hdl-64e", "hdl-32e", "os1-64"]
ScannerName = Literal[SensorName, "facet-ladar"]

Flag = Annotated[bool, Parameter(negative="", show_default=False)]
"""An option that is off unless it is given."""

OutputFile = Annotated[Path | None, Parameter(name=["--output", "-o"])]
"""A file to write, if wanted."""
