"""A Gaussian process over range, and the consensus that grows with it."""

from dataclasses import dataclass

import numpy as np

from scanlock.arrays import Labels, Mask, Vector, read_only
from scanlock.errors import require_count, require_positive
from scanlock.kernels.ground.gaussian_process import grow_sectors


@dataclass(frozen=True, kw_only=True, slots=True)
class Lending:
    """How sectors without a model of their own take one from their neighbours (all ours)."""

    rounds: int = 2
    """How often; each time, models reach farther behind what hides the ground."""

    reach: int = 8
    """Sectors to either side that may lend."""

    gap: float = 1.0
    """How much nearer or farther than the borrower the lender may be [m]."""

    slope_deviation: float = 0.05
    """Standard deviation of the slope, across sectors, of the ground less its mean function."""

    def __post_init__(self) -> None:
        require_count("rounds", self.rounds, 0)
        require_count("reach", self.reach, 1)
        require_positive("gap", self.gap, unit="m")
        require_positive("slope_deviation", self.slope_deviation)


@dataclass(frozen=True, kw_only=True, slots=True)
class GaussianProcess:
    """A smooth random function of range with the squared exponential covariance.

    ``k(r, r') = signal_deviation**2 exp(-(r - r')**2 / (2 length_scale**2))``.
    """

    length_scale: float = 10.0
    """Distance over which heights stay alike [m] (Das and Servos, libwave settings)."""

    signal_deviation: float = 0.5
    """Standard deviation of the ground about its mean function [m] (ours)."""

    noise_deviation: float = 0.06
    """Standard deviation of one prototype about the ground [m] (ours)."""

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
        caps: Vector | None = None,
        lending: Lending | None = None,
    ) -> tuple[Mask, Vector, Vector]:
        """Grow a model of every sector from its seeds (INSAC).

        Parameters
        ----------
        starts : (sectors + 1,)
            Sector s owns the prototypes ``starts[s]:starts[s + 1]``.
        ranges, heights : (n,) [m]
            Prototypes; heights are relative to the mean function. A NaN height never joins.
        seeds : (n,)
            The prototypes each sector starts from.
        variance_limit : float [m^2]
            A prototype joins only where the variance of the model is below this.
        residual_limit : float
            A prototype joins only within this many standard deviations of the model, its own
            noise included.
        caps : (n,) [m], optional
            Largest residual with which each prototype may join, whatever the deviation.
        lending : Lending, optional
            How uncertain sectors take heights from their neighbours; they do not by default.

        Returns
        -------
        accepted : (n,)
            The prototypes of the final models, seeds included.
        mean, variance : (n,) [m, m^2]
            The final models at the ranges of all prototypes; the prior in sectors without any.

        Notes
        -----
        Tongtong, Dai, Liu and He 2011, as summarised by Das et al. 2013, section IV. The
        factor of the covariance grows by one row for each prototype that joins, so no matrix
        is inverted, and only the diagonal of the posterior covariance is ever formed.
        """
        lending = lending if lending is not None else Lending(rounds=0)
        return grow_sectors(
            read_only(starts),
            read_only(ranges),
            read_only(heights),
            read_only(seeds),
            read_only(np.full(len(ranges), np.inf) if caps is None else caps),
            float(self.length_scale),
            float(self.signal_deviation) ** 2,
            float(self.noise_deviation) ** 2,
            float(variance_limit),
            float(residual_limit),
            int(lending.rounds),
            # Farther would be nearer the other way round.
            min(int(lending.reach), (len(starts) - 2) // 2),
            float(lending.slope_deviation),
            float(lending.gap),
        )
