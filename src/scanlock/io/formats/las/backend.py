"""laspy and its decompressor, which are optional dependencies."""

import importlib
from pathlib import Path
from typing import Any

from scanlock.errors import missing_extra


def import_laspy(path: Path) -> Any:
    """Return the module laspy; raise `MissingExtra` if it is not installed."""
    try:
        return importlib.import_module("laspy")
    except ModuleNotFoundError as error:
        raise missing_extra(f"{path}: LAS needs laspy", "las") from error


def require_backend(laspy: Any, path: Path, *, compressed: bool) -> None:
    """Raise `MissingExtra` if the points are compressed and no decompressor is installed."""
    if compressed and not laspy.LazBackend.detect_available():
        raise missing_extra(f"{path}: LAZ needs a decompressor", "las")
