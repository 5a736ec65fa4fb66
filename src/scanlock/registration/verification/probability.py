"""How probable it is that a pose is right: a logistic model of a few numbers.

``probability = 1 / (1 + exp(-(INTERCEPT + sum of WEIGHTS x features)))``. The numbers come from
``benchmarks/uncertainty/probability.py``, which fits them to registrations of simulated and of real
scans whose truth is known, and shows how well they hold on scenes that were left out of the fit.
"""

import math
from collections.abc import Sequence

import numpy as np

from scanlock.arrays import Vector
from scanlock.registration.verification.metrics import Metrics
from scanlock.registration.verification.observability import DirectionObservability

FEATURES = (
    "violation",
    "misfit",
    "log drift over roughness",
    "log deviation of rotation",
    "log distinction",
    "weak",
)
"""What the probability is made of, in this order; see `features`."""

INTERCEPT = 1.54
WEIGHTS = (-7.70, -3.30, -1.11, -0.55, 1.45, -4.56)

_UNKNOWN_VIOLATION = 0.1
"""Where no sensor is at the origin of either frame: a bit more than right poses mostly have."""

_CLOSEST = 0.05
"""Distinction of a rival as good as the pose, which no logarithm could take otherwise."""


def features(metrics: Metrics, directions: Sequence[DirectionObservability]) -> Vector:
    """Return the (6,) numbers that the probability is made of, by the names of `FEATURES`.

    Each between bounds beyond which more says nothing more: a model that is linear must not be
    carried away by a number that it has never seen. `directions` are those of an
    `Observability`, or none.
    """
    turn = max((one.deviation for one in directions if one.kind == "rotation"), default=math.nan)
    runner_up_ratio = (
        1.0 if math.isnan(metrics.runner_up_ratio) else min(1.0, metrics.runner_up_ratio)
    )
    return np.array(
        [
            _UNKNOWN_VIOLATION if math.isnan(metrics.violation) else min(metrics.violation, 0.5),
            1.0 if math.isnan(metrics.outlier_ratio) else min(metrics.outlier_ratio, 1.0),
            _log(metrics.refinement_shift, 0.02, 1.0, unknown=1.0)
            - _log(metrics.roughness, 0.02, 0.5, unknown=0.3),
            _log(turn, 0.0003, 0.03, unknown=0.03),
            math.log(1.0 + _CLOSEST - runner_up_ratio),
            float(any(one.is_degenerate for one in directions)),
        ]
    )


def probability(metrics: Metrics, directions: Sequence[DirectionObservability]) -> float:
    """Return how probable it is that the pose is within 0.3 m and 1 degree of the truth."""
    logit = INTERCEPT + float(np.dot(WEIGHTS, features(metrics, directions)))
    return 1.0 / (1.0 + math.exp(-logit))


def _log(value: float, least: float, most: float, *, unknown: float) -> float:
    return math.log(min(most, max(least, unknown if math.isnan(value) else value)))
