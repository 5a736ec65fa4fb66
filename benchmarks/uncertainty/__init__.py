"""Calibration of the two numbers that accompany a pose: its covariance and its probability.

``covariance`` measures the NEES of the covariances. ``failure_trials`` registers pairs with known
truth, and ``probability`` fits and evaluates the probability that a pose is correct on them. The
errors themselves belong to ``accuracy``.
"""
