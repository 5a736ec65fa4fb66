"""Covariance of an estimated pose.

1. `covariance_estimator`: the settings `CovarianceEstimator`, and its steps: the contributions of
   the cells of the scene to gradient and Hessian, the covariance by one of three methods, the part
   of the sampling pattern, and a minimum.
2. `scene_cells`: the contributions of cells, and the blocks that they form.
3. `sandwich`: the covariance of a minimum by a jackknife over the blocks.
4. `sampling_pattern`: the angles between the samples of a scan, and the error that they cause.
5. `pose_covariance`: the result `PoseCovariance`, with its order, frame and units.
6. `accuracy`: the standard deviations at one point, along named axes, and their sentence.

The probability that a pose is correct belongs to `scanlock.registration.verification`.
"""
