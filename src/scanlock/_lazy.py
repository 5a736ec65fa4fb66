"""Lazy packages: names listed in an ``__init__.pyi`` are imported when they are first used.

The stub is the only list of the names. Type checkers and editors read it as it is.
"""

import ast
from collections.abc import Callable
from importlib import import_module
from pathlib import Path


def attach(
    package: str, file: str
) -> tuple[Callable[[str], object], Callable[[], list[str]], list[str]]:
    """Return ``__getattr__``, ``__dir__`` and ``__all__`` of a package with a stub.

    Parameters
    ----------
    package : str
        ``__name__`` of the package.
    file : str
        ``__file__`` of the package; the stub lies beside it. It has lines of the form
        ``from module import name as name``, or ``from package import module as module``.
    """
    stub = ast.parse(Path(file).with_suffix(".pyi").read_text(encoding="utf-8"))
    homes = {
        alias.asname: node.module
        for node in stub.body
        if isinstance(node, ast.ImportFrom) and node.module is not None
        for alias in node.names
        if alias.asname is not None
    }

    def get(name: str) -> object:
        if name not in homes:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        home = homes[name]
        # Only a module that has not been imported yet is no attribute of its package.
        value = None if home == package else getattr(import_module(home), name, None)
        found = import_module(f"{home}.{name}") if value is None else value
        vars(import_module(package))[name] = found
        return found

    def names() -> list[str]:
        return sorted({*vars(import_module(package)), *homes})

    return get, names, sorted(homes)
