"""Wall time of the stages of one registration."""

import time
from collections.abc import Generator
from contextlib import contextmanager


class StageClock:
    """Adds up the wall time [s] spent under each name."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    @contextmanager
    def stage(self, name: str) -> Generator[None]:
        """Count the time spent inside the ``with`` block under `name`."""
        start = time.perf_counter()
        try:
            yield
        finally:
            self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - start
