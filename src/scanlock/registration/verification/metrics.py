"""Every number that says how well two scans agree at a pose, defined once."""

import math
from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True, slots=True)
class Metrics:
    """How well two scans agree at a pose, whatever method found it.

    The parts of a scan are its clusters above the ground, as Gaussians; where there are too few,
    cubes of the whole scan. They weigh by the fourth root of their points. Its probes are up to
    300 of its points, spread evenly, ground included. A number that cannot be told is NaN.

    Attributes
    ----------
    overlap : float
        Share of the source's parts, by weight, that meet a part of the target: the squared
        Mahalanobis distance of their means, under the sum of their covariances, is below 9. In
        [0, 1]; higher is better.
    target_overlap : float
        The same share of the target's parts that meet a part of the source.
    score : float
        The D2D score of the parts over the geometric mean of the scans' scores with themselves, in
        [0, 1]; higher is better. 1 for a scan with itself; far apart, right poses have 0.1.
    inlier_rmse : float [m]
        Root of the mean squared distance of either scan's probes from planes fitted to the
        other's points within 0.5 m of them (where there are too few, within 1 or 2 m), over the
        inliers: the probes with eight such points or more that lie on no line. Lower is better:
        noise and roughness alone leave some centimetres, sparse scans some decimetres. NaN
        without inliers.
    roughness : float [m]
        What the inlier RMSE is of each scan with itself, root mean square of both: what noise,
        roughness and sparseness leave at any pose.
    misfit : float
        Share of the inliers farther from their plane than twice what points there scatter, once
        the pose has come to rest on the planes (see `refinement_shift`), in [0, 1]; lower is
        better.
    surface_overlap : float
        Share of the source's probes that are inliers, in [0, 1]; higher is better.
    drift : float [m]
        How far steps of Gauss and Newton onto those planes, four at most, would still move the
        source, at 17 m from its origin, where a degree is 0.3 m. Lower is better: right poses
        have centimetres. NaN with fewer than twelve planes.
    violation : float
        Share of the parts that lie where the other scan looked through, of those it would have
        seen, meaned over both scans. In [0, 1]; lower is better: moving objects leave 0.1. NaN
        where the origin of neither frame is a sensor.
    second_best : float
        How well the best rival agrees as a share of the pose chosen, at least 0; lower is better,
        1 is a toss-up. Rivals are the other poses that a search finished, by overlap, score and
        violation together; and the source slid by 0.75 to 10 m along the two directions in which
        the planes hold it least, by score.
    """

    overlap: float = math.nan
    target_overlap: float = math.nan
    score: float = math.nan
    inlier_rmse: float = math.nan
    roughness: float = math.nan
    outlier_ratio: float = math.nan
    fitness: float = math.nan
    refinement_shift: float = math.nan
    violation: float = math.nan
    runner_up_ratio: float = math.nan
