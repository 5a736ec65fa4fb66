"""Robust weights of residuals, so that no kernel has to know a loss function."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from scanlock.arrays import Vector
from scanlock.errors import InvalidInput, require_positive

RobustLoss = Literal["none", "huber", "cauchy", "geman-mcclure", "tukey", "welsch"]
"""Weight as a function of the residual r over the scale c, ``u = |r| / c``.

none 1; huber ``min(1, 1/u)``; cauchy ``1/(1 + u^2)``; geman-mcclure ``1/(1 + u^2)^2``; tukey
``(1 - u^2)^2``, 0 beyond 1; welsch ``exp(-u^2)``.
"""

_WEIGHTS: dict[RobustLoss, Callable[[Vector], Vector]] = {
    "none": lambda u: np.ones_like(u),
    "huber": lambda u: 1.0 / np.maximum(u, 1.0),
    "cauchy": lambda u: 1.0 / (1.0 + u * u),
    "geman-mcclure": lambda u: 1.0 / (1.0 + u * u) ** 2,
    "tukey": lambda u: np.maximum(1.0 - u * u, 0.0) ** 2,
    "welsch": lambda u: np.exp(-u * u),
}

TUNING: dict[RobustLoss, float] = {
    "none": 1.0,
    "huber": 1.345,
    "cauchy": 2.385,
    "geman-mcclure": 3.787,
    "tukey": 4.685,
    "welsch": 2.985,
}
"""Scale over the standard deviation of Gaussian residuals, for 95 % of the efficiency of least
squares."""

_DEVIATION_OVER_MEDIAN = 1.4826
"""Standard deviation of a Gaussian over the median of its absolute value."""


@dataclass(frozen=True, kw_only=True, slots=True)
class RobustWeights:
    """Settings of a robust loss, which gives each residual a weight in [0, 1]."""

    loss: RobustLoss = "none"
    """Robust loss."""

    scale: float | None = None
    """Scale c of the residuals [m]; None estimates it from the median of the residuals."""

    min_scale: float = 0.01
    """Minimum of the estimated scale [m], which is zero for identical scans."""

    def __post_init__(self) -> None:
        if self.loss not in _WEIGHTS:
            raise InvalidInput(f"loss must be one of {', '.join(_WEIGHTS)}, got {self.loss!r}")
        if self.scale is not None:
            require_positive("scale", self.scale, unit="m")
        require_positive("min_scale", self.min_scale, unit="m")

    def scale_for(self, residuals: Vector) -> float:
        """Return the scale c [m]: the fixed one, or one from the median absolute residual."""
        if self.scale is not None:
            return self.scale
        deviation = _DEVIATION_OVER_MEDIAN * float(np.median(np.abs(residuals)))
        return max(TUNING[self.loss] * deviation, self.min_scale)

    def weights(self, residuals: Vector) -> Vector:
        """Return the (m,) weights of at least one residual [m] of either sign."""
        if self.loss == "none":
            # All weights are 1 at any scale: no median is needed.
            return np.ones(len(residuals))
        return _WEIGHTS[self.loss](np.abs(residuals) / self.scale_for(residuals))
