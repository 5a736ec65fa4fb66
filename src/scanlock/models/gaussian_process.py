"""A Gaussian process over range, and the consensus that grows with it."""

from dataclasses import dataclass

import numpy as np

from scanlock.arrays import Labels, Mask, Vector
from scanlock.errors import require_positive
from scanlock.kernels.gaussian_process import insac_sectors


@dataclass(frozen=True, kw_only=True, slots=True)
class GaussianProcess:
    """A smooth random function of range with the squared exponential covariance.

    ``k(r, r') = signal_deviation**2 exp(-(r - r')**2 / (2 length_scale**2))``.
    """

    length_scale: float = 10.0
    """Distance over which heights stay alike [m]."""

    signal_deviation: float = 0.5
    """Standard deviation of the ground about its mean function [m]."""

    noise_deviation: float = 0.1
    """Standard deviation of one prototype about the ground [m]."""

    def __post_init__(self) -> None:
        require_positive("length_scale", self.length_scale, unit="m")
        require_positive("signal_deviation", self.signal_deviation, unit="m")
        require_positive("noise_deviation", self.noise_deviation, unit="m")

    def consensus(
        self,
        starts: Labels,
        ranges: Vector,
        heights: Vector,
        seeds: Mask,
        *,
        variance_limit: float,
        residual_limit: float,
    ) -> tuple[Mask, Vector, Vector]:
        """Grow a model of every sector from its seeds: INSAC of Tongtong et al. 2011.

        Parameters
        ----------
        starts : (sectors + 1,)
            Sector s owns the prototypes ``starts[s]:starts[s + 1]``.
        ranges, heights : (n,) [m]
            Prototypes; heights are relative to the mean function.
        seeds : (n,)
            The prototypes each sector starts from.
        variance_limit : float [m^2]
            A prototype joins only where the model is at least this certain.
        residual_limit : float
            A prototype joins only within this many standard deviations of the model.

        Returns
        -------
        accepted : (n,)
            The prototypes of the final models, seeds included.
        mean, variance : (n,) [m, m^2]
            The final models at the ranges of all prototypes; without seeds, the prior.
        """
        return insac_sectors(
            starts,
            ranges,
            heights,
            seeds.astype(np.int64),
            self.length_scale,
            self.signal_deviation**2,
            self.noise_deviation**2,
            variance_limit,
            residual_limit,
        )
