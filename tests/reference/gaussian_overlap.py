"""Overlap of Gaussians by definition, pair by pair."""

import numpy as np


def overlaps(target_means, target_covariances, source_means, source_covariances, max_squared):
    """Whether any target is within a squared Mahalanobis distance of each source."""
    return [
        any(
            (m - n) @ np.linalg.inv(s + t) @ (m - n) < max_squared
            for n, t in zip(target_means, target_covariances, strict=True)
        )
        for m, s in zip(source_means, source_covariances, strict=True)
    ]
