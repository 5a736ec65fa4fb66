"""Kernels of the global search for a pose: BEV grids, ground alignment, cluster matching.

Kernels that judge a pose belong to `kernels.verification`.
"""
