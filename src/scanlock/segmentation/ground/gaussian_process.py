"""Gaussian process regression of the ground over range, and its growth by INSAC."""

from dataclasses import dataclass, field

import numpy as np

from scanlock.arrays import Labels, Mask, Vector, read_only
from scanlock.errors import require_count, require_positive
from scanlock.kernels.ground.gaussian_process import grow_sectors


@dataclass(frozen=True, kw_only=True, slots=True)
class GaussianProcess:
    """Settings of a Gaussian process over range with squared exponential covariance.

    ``k(r, r') = signal_deviation**2 exp(-(r - r')**2 / (2 length_scale**2))``.
    """

    length_scale: float = 10.0
    """Correlation length of heights over range [m] (settings of libwave)."""

    signal_deviation: float = 0.5
    """Standard deviation of the ground about its mean function [m] (ours)."""

    noise_deviation: float = 0.06
    """Standard deviation of a prototype about the ground [m] (ours)."""

    def __post_init__(self) -> None:
        require_positive("length_scale", self.length_scale, unit="m")
        require_positive("signal_deviation", self.signal_deviation, unit="m")
        require_positive("noise_deviation", self.noise_deviation, unit="m")


@dataclass(frozen=True, kw_only=True, slots=True)
class SectorInterpolation:
    """Settings of the interpolation of uncertain sectors from neighbouring sectors (all ours).

    An uncertain prototype takes the heights of the nearest certain sector on either side as
    observations. Their variance increases with the distance across sectors.
    """

    iterations: int = 2
    """Number of passes; each extends the models further into occluded regions. 0 disables it."""

    max_sectors: int = 8
    """Maximum number of sectors between a prototype and an observation."""

    max_range_difference: float = 1.0
    """Maximum difference in range between a prototype and an observation [m]."""

    slope_deviation: float = 0.05
    """Standard deviation of the slope across sectors of the ground about its mean function."""

    def __post_init__(self) -> None:
        require_count("iterations", self.iterations, 0)
        require_count("max_sectors", self.max_sectors, 1)
        require_positive("max_range_difference", self.max_range_difference, unit="m")
        require_positive("slope_deviation", self.slope_deviation)


@dataclass(frozen=True, kw_only=True, slots=True)
class Insac:
    """Settings of incremental sample consensus (INSAC) with one Gaussian process per sector."""

    process: GaussianProcess = field(default_factory=GaussianProcess)
    """Process of the ground of one sector about its mean function."""

    variance_threshold: float = 0.04
    """Variance of the model below which a prototype may join and a height is known [m^2].

    T_model (ours). The published value of 5 exceeds every variance.
    """

    residual_threshold: float = 3.0
    """Residual below which a prototype joins, in standard deviations: T_data (ours)."""

    interpolation: SectorInterpolation = field(default_factory=SectorInterpolation)
    """Interpolation of sectors with occluded ground."""

    def __post_init__(self) -> None:
        require_positive("variance_threshold", self.variance_threshold, unit="m^2")
        require_positive("residual_threshold", self.residual_threshold)

    def grow(
        self,
        starts: Labels,
        ranges: Vector,
        heights: Vector,
        seeds: Mask,
        max_residuals: Vector | None = None,
    ) -> tuple[Mask, Vector, Vector]:
        """Grow the model of every sector from its seeds.

        Parameters
        ----------
        starts : (sectors + 1,)
            Sector s has the prototypes ``starts[s]:starts[s + 1]``.
        ranges, heights : (n,) [m]
            Ranges of the prototypes, and their heights above the mean function. Prototypes with a
            NaN height never join.
        seeds : (n,)
            Prototypes of the initial models.
        max_residuals : (n,) [m], optional
            Additional threshold on the residual of each prototype; infinite by default.

        Returns
        -------
        accepted : (n,)
            Prototypes of the final models, seeds included.
        mean : (n,) [m]
            Mean of the final models at the prototypes; zero in sectors without a model.
        variance : (n,) [m^2]
            Variance of the final models at the prototypes; that of the prior without a model.

        Notes
        -----
        Tongtong, Dai, Liu and He 2011, as summarised in section IV of Das et al. 2013. The Cholesky
        factor of the covariance is extended by one row for each prototype that joins. Only the
        diagonal of the posterior covariance is computed.
        """
        process, interpolation = self.process, self.interpolation
        unlimited = np.full(len(ranges), np.inf)
        return grow_sectors(
            read_only(starts),
            read_only(ranges),
            read_only(heights),
            read_only(seeds),
            read_only(unlimited if max_residuals is None else max_residuals),
            float(process.length_scale),
            float(process.signal_deviation) ** 2,
            float(process.noise_deviation) ** 2,
            float(self.variance_threshold),
            float(self.residual_threshold),
            int(interpolation.iterations),
            # No more than half of the circle: the other direction is shorter beyond it.
            min(int(interpolation.max_sectors), (len(starts) - 2) // 2),
            float(interpolation.slope_deviation),
            float(interpolation.max_range_difference),
        )
