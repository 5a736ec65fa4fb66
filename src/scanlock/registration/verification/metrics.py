"""Metrics of a registration, each defined once and the same for every method."""

import math
from dataclasses import dataclass

from scanlock.arrays import short_repr


@dataclass(frozen=True, kw_only=True, slots=True)
class Metrics:
    """How well two scans agree at a pose; a metric that cannot be computed is NaN.

    The *Gaussians* of a scan are those of its clusters above the ground, or of voxels of the
    whole scan where there are too few clusters. Their weight is the fourth root of their number
    of points. The *query points* of a scan are up to 300 of its points, 2000 of sparse clouds,
    evenly distributed, ground included.

    Attributes
    ----------
    overlap : float
        Weighted fraction of the source's Gaussians that overlap a Gaussian of the target, in
        [0, 1]. Two Gaussians overlap if the squared Mahalanobis distance of their means, under
        the sum of their covariances, is below 9. Higher is better.
    target_overlap : float
        The same fraction of the target's Gaussians.
    score : float
        D2D score of the Gaussians divided by the geometric mean of the scores of each scan with
        itself, in [0, 1]. Higher is better: 1 for identical scans; correct poses between distant
        viewpoints have 0.1.
    inlier_rmse : float [m]
        Root mean squared distance between the query points of either scan and planes fitted to
        the other scan, over the inliers. A plane is fitted within 0.5 m, or 1 or 2 m where points
        are sparse. Inliers are the query points with a plane: at least eight neighbours, not on
        a line. Lower is better: noise and roughness cause centimetres, sparse scans decimetres.
        NaN without inliers.
    roughness : float [m]
        The inlier RMSE of each scan with itself, root mean square of both: the effect of noise,
        roughness and sparseness at any pose.
    outlier_ratio : float
        Fraction of inliers with a residual above two standard deviations of the points around
        their plane, after refinement (see `refinement_shift`), in [0, 1]. Lower is better.
    fitness : float
        Fraction of the source's query points that are inliers, in [0, 1]. Higher is better.
    refinement_shift : float [m]
        Distance by which point-to-plane refinement would move the source at 17 m from its origin,
        where a degree is 0.3 m. Refinement takes at most four Gauss-Newton steps. Lower is
        better: correct poses have centimetres. NaN with fewer than twelve planes.
    free_space_violation : float
        Fraction of Gaussians in the free space of the other scan, among those in its field of
        view and not occluded; mean of both scans, in [0, 1]. Lower is better: moving objects
        cause 0.1. NaN if no frame has its origin at the sensor.
    runner_up_ratio : float
        Agreement of the best other pose divided by that of the estimate, at least 0. Lower is
        better; 1 is a tie. Other poses are the candidates of a search, compared by overlap, score
        and plausibility. They are also the source shifted by 0.75 to 10 m along the two least
        constrained translations, compared by score.
    object_log_odds : float
        Log odds of this place against look-alikes, by low objects that the other scan confirms or
        that are in its free space. Higher is better: streets have 15 to 100, scenes without such
        objects 0. NaN if no frame has its origin at the sensor.
    self_similarity : float
        Largest correlation of the view from above of both scans with themselves after a motion of
        1.5 to 20 m, a quarter turn or half a turn, in [0, 1]; 0 without one. Colonnades and car
        parks have 0.5 and more.
    scale_difference : float
        Relative difference of scale of the source that point-to-plane refinement would estimate
        as a seventh parameter. Scans of one scale have 0.0005 or less.
    scale_deviation : float
        Standard deviation of the difference of scale.
    """

    overlap: float = math.nan
    target_overlap: float = math.nan
    score: float = math.nan
    inlier_rmse: float = math.nan
    roughness: float = math.nan
    outlier_ratio: float = math.nan
    fitness: float = math.nan
    refinement_shift: float = math.nan
    free_space_violation: float = math.nan
    runner_up_ratio: float = math.nan
    object_log_odds: float = math.nan
    self_similarity: float = math.nan
    scale_difference: float = math.nan
    scale_deviation: float = math.nan

    __repr__ = short_repr
