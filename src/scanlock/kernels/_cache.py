"""Cache of machine code on disk, keyed by a digest of the source of a kernel.

Numba stamps a cached kernel by the modification time of its own file. Kernels also call helpers
of `_inline`, which are compiled into them, so the digest covers the files of this folder that
begin with an underscore. Below ``NUMBA_CACHE_DIR`` it names the folder: checkouts with the same
kernels share one cache.
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
_OnCompile = Callable[[str | None], bool]
"""Called with the cache folder of a kernel, or None, before the kernel is compiled.

Returns whether the machine code may be on disk now."""

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


def kernel_cache(function: _Function, on_compile: _OnCompile) -> Any:
    """Return the cache of a kernel, which calls `on_compile` where it lacks the machine code.

    Where no folder is writable (read-only installation and home), the kernel is compiled in each
    process.
    """
    try:
        return _KernelCache(function, on_compile)
    except RuntimeError:
        return _NoCache(on_compile)


class _SharedFolder(_caching._CacheLocator):
    """Locator of a kernel in ``NUMBA_CACHE_DIR`` by its digest, wherever its source file lies."""

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


class _KernelCache(_caching.FunctionCache):
    """Cache of one kernel on disk."""

    _impl_class = _Impl

    def __init__(self, function: _Function, on_compile: _OnCompile) -> None:
        super().__init__(function)
        self._on_compile = on_compile
        self._cache_file = _caching.IndexDataCacheFile(
            cache_path=self.cache_path,
            filename_base=self._impl.filename_base,
            source_stamp=digest_of(inspect.getfile(function)),
        )

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        found = super().load_overload(sig, target_context)
        if found is None and self._on_compile(self.cache_path):
            found = super().load_overload(sig, target_context)
        return found

    def has(self, sig: Any, target_context: Any) -> bool:
        """Return whether the machine code of a signature is on disk, without loading it."""
        target_context.refresh()
        key = self._index_key(sig, target_context.codegen())
        return key in self._cache_file._load_index()


class _NoCache(_caching.NullCache):
    """Cache of one kernel where no folder is writable: it holds nothing."""

    def __init__(self, on_compile: _OnCompile) -> None:
        self._on_compile = on_compile

    def load_overload(self, sig: Any, target_context: Any) -> None:
        self._on_compile(None)

    def has(self, sig: Any, target_context: Any) -> bool:
        """Return True: compiling a kernel ahead would be of no use."""
        return True
