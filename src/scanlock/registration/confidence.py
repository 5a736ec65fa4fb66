"""How probable it is that a pose is right: a logistic model of a few numbers.

``probability = 1 / (1 + exp(-(INTERCEPT + sum of WEIGHTS x features)))``. The numbers come from
``benchmarks/confidence.py``, which fits them to registrations of simulated and of real scans whose
truth is known, and shows how well they hold on scenes that were left out of the fit.
"""

import math
from collections.abc import Sequence

import numpy as np

from scanlock.arrays import Vector
from scanlock.registration.hold import HeldDirection
from scanlock.registration.metrics import Metrics

FEATURES = (
    "log score",
    "violation",
    "log inlier rmse",
    "log drift",
    "log deviation",
    "log hold of rotation",
    "log distinction",
)
"""What the probability is made of, in this order; see `features`."""

INTERCEPT = 6.13
WEIGHTS = (0.09, -13.43, 1.24, -0.90, -0.45, 0.94, 1.44)

_HOLDING = slice(4, 7)
_FIRM = (math.log(0.003), math.log(0.3), math.log(1.05))
"""Deviation, hold of rotation and distinction of a pose that everything holds."""

_UNKNOWN_VIOLATION = 0.1
"""Where no sensor is at the origin of either frame: a bit more than right poses mostly have."""

_CLOSEST = 0.05
"""Distinction of a rival as good as the pose, which no logarithm could take otherwise."""


def features(metrics: Metrics, directions: Sequence[HeldDirection]) -> Vector:
    """Return the (7,) numbers that the probability is made of, by the names of `FEATURES`.

    Logarithms, each between bounds beyond which more says nothing more: a model that is linear
    must not be carried away by a number that it has never seen. `directions` are those of a
    `Hold`, or none.
    """
    least, turn = (directions[0], directions[3]) if directions else (None, None)
    second_best = 1.0 if math.isnan(metrics.second_best) else min(1.0, metrics.second_best)
    return np.array(
        [
            _log(metrics.score, 0.03, 1.0, unknown=0.03),
            _UNKNOWN_VIOLATION if math.isnan(metrics.violation) else min(metrics.violation, 0.5),
            _log(metrics.inlier_rmse, 0.03, 0.3, unknown=0.3),
            _log(metrics.drift, 0.01, 1.0, unknown=1.0),
            _log(math.nan if least is None else least.deviation, 0.003, 0.3, unknown=0.3),
            _log(math.nan if turn is None else turn.share, 0.01, 0.3, unknown=0.01),
            math.log(1.0 + _CLOSEST - second_best),
        ]
    )


def probability(
    metrics: Metrics, directions: Sequence[HeldDirection], *, is_held: bool = False
) -> float:
    """Return how probable it is that the pose is within 0.3 m and 1 degree of the truth.

    With `is_held`, as if every direction were held as firmly as can be: whether the scans agree
    at all, wherever along its weak directions the pose may be.
    """
    seen = features(metrics, directions)
    if is_held:
        seen[_HOLDING] = _FIRM
    logit = INTERCEPT + float(np.dot(WEIGHTS, seen))
    return 1.0 / (1.0 + math.exp(-logit))


def _log(value: float, least: float, most: float, *, unknown: float) -> float:
    return math.log(min(most, max(least, unknown if math.isnan(value) else value)))
