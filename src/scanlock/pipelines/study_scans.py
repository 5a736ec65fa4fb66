"""Scans of a study, loaded and prepared once for the registrations that share them."""

from collections.abc import Callable, Mapping
from typing import Any, TypeVar

from numpy.typing import ArrayLike

from scanlock.clouds.point_cloud import PointCloud
from scanlock.errors import ScanlockError
from scanlock.registration.methods.protocol import Method
from scanlock.registration.prepare import PreparedScan, prepare
from scanlock.threads import using_threads

_Cached = TypeVar("_Cached", PointCloud, PreparedScan)


class StudyScans:
    """Loaded and prepared scans of the current pair, or the errors that they raised.

    Parameters
    ----------
    methods : mapping of str to Method
        Methods by name.
    load : callable
        Function that returns the (n, 3+) points [m] of a scan, given its name.
    threads : int
        Maximum number of threads to prepare a scan.
    """

    def __init__(
        self,
        methods: Mapping[str, Method[Any]],
        load: Callable[[str], ArrayLike | PointCloud],
        threads: int,
    ) -> None:
        self._methods, self._load, self._threads = methods, load, threads
        self._clouds: dict[str, PointCloud | ScanlockError] = {}
        self._prepared: dict[tuple[str, str], PreparedScan | ScanlockError] = {}

    def keep_only(self, scan: str) -> None:
        """Forget all scans but one."""
        self._clouds = {name: cloud for name, cloud in self._clouds.items() if name == scan}
        self._prepared = {key: data for key, data in self._prepared.items() if key[0] == scan}

    def prepared(self, scan: str, method: str) -> PreparedScan:
        """Return a scan as prepared by a method, both by name.

        Raises
        ------
        ScanlockError
            The scan cannot be loaded or prepared.
        """
        key = (scan, method)
        if key not in self._prepared:
            try:
                with using_threads(self._threads):
                    self._prepared[key] = prepare(self.cloud(scan), method=self._methods[method])
            except ScanlockError as error:
                self._prepared[key] = error
        return _value_or_raise(self._prepared[key])

    def cloud(self, scan: str) -> PointCloud:
        """Return the checked points of a scan, by name.

        Raises
        ------
        ScanlockError
            The scan cannot be loaded.
        """
        if scan not in self._clouds:
            try:
                self._clouds[scan] = PointCloud.from_array(self._load(scan), f"scan {scan}")
            except ScanlockError as error:
                self._clouds[scan] = error
        return _value_or_raise(self._clouds[scan])


def _value_or_raise(cached: _Cached | ScanlockError) -> _Cached:
    if isinstance(cached, ScanlockError):
        raise cached
    return cached
