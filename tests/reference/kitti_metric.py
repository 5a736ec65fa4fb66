"""KITTI odometry metric, written step by step from its definition."""

import itertools
import math

import numpy as np

LENGTHS = range(100, 900, 100)


def segment_errors(estimate, truth, every=10):
    """Compute (first frame, last frame, metres per metre, radians per metre) of each segment.

    `estimate` and `truth` are lists of 4x4 matrices. A segment starts at every tenth frame and
    ends at the first frame whose path length along the truth exceeds that of the start by more
    than the nominal one; both errors are divided by the nominal length.
    """
    along = [0.0]
    for before, after in itertools.pairwise(truth):
        along.append(along[-1] + math.dist(before[:3, 3], after[:3, 3]))
    found = []
    for first in range(0, len(truth), every):
        for length in LENGTHS:
            last = next(
                (k for k in range(first, len(truth)) if along[k] > along[first] + length), None
            )
            if last is None:
                continue
            true_motion = np.linalg.inv(truth[first]) @ truth[last]
            motion = np.linalg.inv(estimate[first]) @ estimate[last]
            error = np.linalg.inv(motion) @ true_motion
            cosine = 0.5 * (error[0, 0] + error[1, 1] + error[2, 2] - 1.0)
            angle = math.acos(max(-1.0, min(1.0, cosine)))
            found.append((first, last, math.hypot(*error[:3, 3]) / length, angle / length))
    return found
