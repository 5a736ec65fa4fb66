"""The registry of methods: the built-in ones, registered ones, and those of installed packages."""

from collections.abc import Iterator, Mapping
from difflib import get_close_matches
from importlib.metadata import EntryPoint, entry_points
from typing import Any

from scanlock.errors import InvalidInput
from scanlock.registration.methods.auto.auto import Auto
from scanlock.registration.methods.gicp import Gicp
from scanlock.registration.methods.icp.annealing import AnnealedStart
from scanlock.registration.methods.icp.correspondences import VoxelSearch
from scanlock.registration.methods.icp.icp import Icp
from scanlock.registration.methods.mskm_ndt import MskmNdt
from scanlock.registration.methods.ndt import Ndt
from scanlock.registration.methods.ndt_d2d import NdtD2d
from scanlock.registration.methods.protocol import Method
from scanlock.registration.methods.sgc_ndt import SgcNdt

DEFAULT_METHOD = "auto"

ENTRY_POINTS = "scanlock.methods"
"""Entry-point group by which an installed package offers methods, each under its name."""


class _Methods(Mapping[str, Method[Any]]):
    """Methods by name, read-only; entry points are loaded when they are asked for."""

    def __init__(self, built_in: Mapping[str, Method[Any]]) -> None:
        self._methods = dict(built_in)
        self._offered: dict[str, EntryPoint] | None = None

    def __getitem__(self, name: str) -> Method[Any]:
        if name not in self._methods and name in self._entry_points():
            self._methods[name] = _checked(name, self._entry_points()[name].load())
        return self._methods[name]

    def __iter__(self) -> Iterator[str]:
        yield from dict.fromkeys((*self._methods, *self._entry_points()))

    def __len__(self) -> int:
        return len(set(self._methods) | set(self._entry_points()))

    def add(self, name: str, method: Method[Any], *, replace: bool) -> None:
        """Add a method under a new name, or in place of the one that has it."""
        if name in self and not replace:
            raise InvalidInput(
                f"name must not be taken, got {name!r}; pass replace=True to replace that method"
            )
        self._methods[name] = method

    def _entry_points(self) -> dict[str, EntryPoint]:
        if self._offered is None:
            self._offered = {one.name: one for one in entry_points(group=ENTRY_POINTS)}
        return self._offered


_REGISTERED = _Methods(
    {
        "auto": Auto(),
        "sgc-ndt-d2d": SgcNdt(score="d2d"),
        "sgc-ndt-p2d": SgcNdt(score="p2d"),
        "gicp": Gicp(),
        "vgicp": Gicp(search=VoxelSearch()),
        "icp": Icp(),
        "icp-annealed": Icp(annealing=AnnealedStart()),
        "ndt": Ndt(),
        "ndt-d2d": NdtD2d(),
        "mskm-ndt": MskmNdt(),
    }
)

METHODS: Mapping[str, Method[Any]] = _REGISTERED
"""Each method by name, with its default settings; read-only, see `register_method`."""


def register_method(name: str, method: Method[Any], *, replace: bool = False) -> None:
    """Make a method available by name: to `register`, settings files and the command line.

    A package offers its methods to every process with an entry point of the group
    ``scanlock.methods``, whose object is the method.

    Parameters
    ----------
    name : str
        Lower case, without spaces.
    method : Method
        Settings with `prepare` and `align`.
    replace : bool
        Whether an existing method of this name may be replaced.

    Raises
    ------
    InvalidInput
        A name that is taken or not in lower case, or an object without `prepare` and `align`.
    """
    if name != name.lower() or not name or any(one.isspace() for one in name):
        raise InvalidInput(f"name must be lower case without spaces, got {name!r}")
    _REGISTERED.add(name, _checked(name, method), replace=replace)


def named_method(method: str | Method[Any]) -> tuple[str, Method[Any]]:
    """Return the name and the settings of a method given by either.

    Raises
    ------
    InvalidInput
        An unknown name, a class in place of an instance, or an object that is not a method.
    """
    if not isinstance(method, str):
        return type(method).__name__, _checked("method", method)
    name = method.lower()
    if name not in METHODS:
        close = get_close_matches(name, METHODS, n=1)
        hint = f"; did you mean {close[0]!r}?" if close else ""
        raise InvalidInput(f"method must be one of {', '.join(METHODS)}, got {method!r}{hint}")
    return name, METHODS[name]


def _checked(name: str, method: Any) -> Method[Any]:
    if isinstance(method, type):
        raise InvalidInput(
            f"{name} must be an instance, got the class {method.__name__}; "
            f"write {method.__name__}()"
        )
    missing = [one for one in ("prepare", "align") if not callable(getattr(method, one, None))]
    if missing:
        raise InvalidInput(
            f"{name} must be a name or have prepare and align, got {type(method).__name__} "
            f"without {' and '.join(missing)}"
        )
    return method
