"""Option types that several commands share.

The names repeat the keys of their dictionaries, because importing those would load Numba before
help is printed. A test compares the two.
"""

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

MethodName = str
"""Key of `METHODS`: built-in, registered, or offered by an installed package."""

DofName = Literal["xyz+rpy", "xyz+yaw", "xy+yaw"]
CovarianceName = Literal["sandwich", "hessian", "sampled", "none"]
FormatName = Literal[
    "bin", "npy", "npz", "pcd", "ply", "txt", "las", "e57", "ptx", "pts", "vtk", "vtp", "obj"
]
SceneName = Literal["street", "forest", "rugged"]
SensorName = Literal[
    "hdl-64e", "hdl-32e", "os1-64", "vlp-16", "vlp-32c", "os1-128", "os0-128", "livox-avia"
]
ScannerName = Literal[SensorName, "facet-ladar"]

Flag = Annotated[bool, Parameter(negative="", show_default=False)]
"""An option that is off by default."""

OutputFile = Annotated[Path | None, Parameter(name=["--output", "-o"])]
"""An optional output file."""
