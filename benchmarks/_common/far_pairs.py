"""Simulated pairs at given distances, with any heading."""

import math
from collections.abc import Iterator, Sequence

import numpy as np

from scanlock.simulation import SCENES, SimulatedPair, scan_pair

BASELINES = ((0.0, 10.0), (10.0, 20.0), (20.0, 30.0))
"""Distances between the scans of a pair [m]."""

SENSORS = ("hdl_64e", "os1_64", "hdl_32e")


def far_pairs(
    kind: str, seed: int, baselines: Sequence[tuple[float, float]] = BASELINES
) -> Iterator[tuple[tuple[float, float], SimulatedPair]]:
    """Yield one pair per distance class in the scene of a seed."""
    scene = SCENES[kind](np.random.default_rng(seed))
    for baseline in baselines:
        sensor = SENSORS[seed % 3]
        yield baseline, scan_pair(scene, sensor, seed, baseline=baseline, turn=math.pi)
