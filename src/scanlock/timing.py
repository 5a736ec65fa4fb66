"""Wall time of the stages of a registration."""

import time
from collections.abc import Generator
from contextlib import contextmanager


class StageClock:
    """Accumulates the wall time of named stages.

    Attributes
    ----------
    seconds : dict of str to float [s]
        Total wall time of each stage.
    """

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    @contextmanager
    def stage(self, name: str) -> Generator[None]:
        """Add the wall time of the ``with`` block to the stage `name`."""
        start = time.perf_counter()
        try:
            yield
        finally:
            self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - start
