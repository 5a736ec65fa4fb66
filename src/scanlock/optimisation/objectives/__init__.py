"""Objectives of registration, with exact derivatives in the pose.

An objective has fixed correspondences or fixed models. Searches for correspondences are in
`scanlock.registration.methods.icp.correspondences`, loops over points in `scanlock.kernels`.
"""

from scanlock._lazy import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
