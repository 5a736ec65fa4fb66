"""The cache of machine code on disk, keyed by a digest of the source of a kernel.

Numba stamps a cached kernel by its own file. Kernels also call helpers of `_inline`, which are
compiled into them, so the digest covers the files of this folder that begin with an underscore.
Below ``NUMBA_CACHE_DIR`` it names the folder: checkouts with the same kernels share one cache.
"""

import functools
import hashlib
import inspect
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba
from numba.core import caching

_Function = Callable[..., Any]

# Numba's types of these classes are wrong: methods that return a path are typed as None.
_numba: Any = numba
_caching: Any = caching


@functools.cache
def digest_of(path: str) -> str:
    """Return the digest of a kernel's file and of the files it may call into."""
    digest = hashlib.sha256()
    for file in (Path(path), *sorted(Path(__file__).parent.glob("_*.py"))):
        digest.update(file.read_bytes())
    return digest.hexdigest()[:16]


class _SharedFolder(_caching._CacheLocator):
    """Locates a kernel in ``NUMBA_CACHE_DIR`` by its digest, wherever its source file lies."""

    def __init__(self, function: _Function, path: str) -> None:
        self._line = function.__code__.co_firstlineno
        self._digest = digest_of(path)
        source = Path(path)
        name = f"scanlock-{source.parent.name}-{source.stem}-{self._digest}"
        self._folder = str(Path(_numba.config.CACHE_DIR) / name)

    def get_cache_path(self) -> str:
        return self._folder

    def get_source_stamp(self) -> str:
        return self._digest

    def get_disambiguator(self) -> str:
        return str(self._line)

    @classmethod
    def from_function(cls, function: _Function, path: str) -> "_SharedFolder | None":
        if not _numba.config.CACHE_DIR or not Path(path).is_file():
            return None
        found = cls(function, path)
        try:
            found.ensure_cache_path()
        except OSError:
            return None
        return found


class _Impl(_caching.CompileResultCacheImpl):
    _locator_classes = (_SharedFolder, *_caching.CompileResultCacheImpl._locator_classes)


class KernelCache(_caching.FunctionCache):
    """The cache of one kernel.

    Raises
    ------
    RuntimeError
        No folder is writable.
    """

    _impl_class = _Impl

    def __init__(self, function: _Function) -> None:
        super().__init__(function)
        self._cache_file = _caching.IndexDataCacheFile(
            cache_path=self.cache_path,
            filename_base=self._impl.filename_base,
            source_stamp=digest_of(inspect.getfile(function)),
        )
