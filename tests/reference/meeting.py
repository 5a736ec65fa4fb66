"""Which Gaussians meet, pair by pair."""

import numpy as np


def meet(target_means, target_covariances, source_means, source_covariances, limit):
    """Whether any target lies within squared Mahalanobis distance `limit` of each source."""
    return [
        any(
            (m - n) @ np.linalg.inv(s + t) @ (m - n) < limit
            for n, t in zip(target_means, target_covariances, strict=True)
        )
        for m, s in zip(source_means, source_covariances, strict=True)
    ]
