"""Gaussian and surface models of point clouds.

What belongs here is estimated from the points of one scan, without their segmentation. Gaussians
of clusters are in `scanlock.segmentation`, and scores between models are in
`scanlock.optimisation.objectives`.
"""
