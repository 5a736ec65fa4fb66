"""Optimisation over poses: solvers and the objectives that they minimise.

The choice of scales and correspondences belongs to `scanlock.registration.methods`.
"""
