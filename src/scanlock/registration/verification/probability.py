"""Probability that a pose is correct: a logistic model of seven numbers.

``probability = 1 / (1 + exp(-(INTERCEPT + sum of WEIGHTS x features)))``.
``benchmarks/uncertainty/probability.py`` fits the weights to registrations of simulated and real
scans with ground truth, and measures the calibration on scenes left out of the fit.
"""

import math
from collections.abc import Sequence

import numpy as np

from scanlock.arrays import Vector
from scanlock.registration.verification.metrics import Metrics
from scanlock.registration.verification.object_odds import MAX_LOG_ODDS, MIN_LOG_ODDS
from scanlock.registration.verification.observability import DirectionObservability

FEATURES = (
    "free-space violation",
    "outlier ratio",
    "log of refinement shift over roughness",
    "log of rotation deviation",
    "log of runner-up margin",
    "degenerate",
    "object log odds",
)
"""Names of the features of the model, in the order of `WEIGHTS`; see `features`."""

INTERCEPT = 1.60
WEIGHTS = (-8.33, -6.77, -0.66, -0.26, 0.61, -3.04, 0.86)

_DEFAULT_VIOLATION = 0.1
"""Free-space violation if unknown: slightly more than most correct poses have."""

_DEFAULT_LOG_ODDS = 0.5
"""Object log odds if unknown: slightly less than most correct poses have."""

_MIN_MARGIN = 0.05
"""Runner-up margin of a tie; it keeps the logarithm finite."""


def model_inputs(metrics: Metrics, directions: Sequence[DirectionObservability]) -> Vector:
    """Return the (7,) features of the model, in the order of `FEATURES`.

    Each is clipped to the range of the training data, since a linear model extrapolates without
    bound.

    Parameters
    ----------
    metrics : Metrics
    directions : sequence of DirectionObservability
        All directions of an `Observability`; empty if unknown.
    """
    rotation_deviation = max(
        (one.deviation for one in directions if one.kind == "rotation"), default=math.nan
    )
    runner_up_ratio = _known(metrics.runner_up_ratio, 1.0)
    return np.array(
        [
            min(_known(metrics.free_space_violation, _DEFAULT_VIOLATION), 0.5),
            min(_known(metrics.outlier_ratio, 1.0), 1.0),
            _log(_known(metrics.refinement_shift, 1.0), 0.02, 1.0)
            - _log(_known(metrics.roughness, 0.3), 0.02, 0.5),
            _log(_known(rotation_deviation, 0.03), 0.0003, 0.03),
            math.log(1.0 + _MIN_MARGIN - min(runner_up_ratio, 1.0)),
            float(any(one.is_degenerate for one in directions)),
            min(
                MAX_LOG_ODDS, max(MIN_LOG_ODDS, _known(metrics.object_log_odds, _DEFAULT_LOG_ODDS))
            ),
        ]
    )


def log_odds(metrics: Metrics, directions: Sequence[DirectionObservability]) -> float:
    """Return the logarithm of the odds that the pose is within 0.3 m and 1 degree of the truth."""
    return INTERCEPT + float(np.dot(WEIGHTS, model_inputs(metrics, directions)))


def probability(metrics: Metrics, directions: Sequence[DirectionObservability]) -> float:
    """Return the probability that the pose is within 0.3 m and 1 degree of the truth."""
    return 1.0 / (1.0 + math.exp(-log_odds(metrics, directions)))


def _known(value: float, default: float) -> float:
    """Return a number, or the default if it is NaN."""
    return default if math.isnan(value) else value


def _log(value: float, low: float, high: float) -> float:
    """Return the logarithm of a number clipped to [low, high]."""
    return math.log(min(high, max(low, value)))
