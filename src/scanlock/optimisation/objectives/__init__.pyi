from scanlock.optimisation.objectives.cell_scores import PointsToCells as PointsToCells
from scanlock.optimisation.objectives.constraints import UNCONSTRAINED as UNCONSTRAINED
from scanlock.optimisation.objectives.constraints import Constraints as Constraints
from scanlock.optimisation.objectives.constraints import PosePrior as PosePrior
from scanlock.optimisation.objectives.distribution_pairs import (
    DistributionPairs as DistributionPairs,
)
from scanlock.optimisation.objectives.gaussian_scores import (
    GaussiansToGaussians as GaussiansToGaussians,
)
from scanlock.optimisation.objectives.gaussian_scores import PointsToGaussians as PointsToGaussians
from scanlock.optimisation.objectives.gaussian_scores import ScoreShape as ScoreShape
from scanlock.optimisation.objectives.point_pairs import PointPairs as PointPairs
from scanlock.optimisation.objectives.point_pairs import plane_precisions as plane_precisions
from scanlock.optimisation.objectives.point_pairs import point_precisions as point_precisions
from scanlock.optimisation.objectives.robust_weights import RobustWeights as RobustWeights

__all__: list[str]
