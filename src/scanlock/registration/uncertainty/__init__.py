"""Covariance of an estimated pose.

1. `covariance_estimator`: the settings `CovarianceEstimator`, and its steps: the contributions of
   the blocks of the scene to gradient and Hessian, the covariance by one of three methods, the
   inflation of roll and pitch, and a minimum.
2. `sandwich`: the covariance of a minimum by a jackknife over the blocks.
3. `pose_covariance`: the result `PoseCovariance`, with its order, frame and units.
4. `accuracy`: the standard deviations at one point, along named axes, and their sentence.

The probability that a pose is correct belongs to `scanlock.registration.verification`.
"""
