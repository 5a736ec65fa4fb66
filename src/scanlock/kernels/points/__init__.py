"""Kernels on the points of one scan: search trees, voxels, polar cells, neighbourhoods, moments.

Kernels that know ground or clusters belong to `kernels.ground`.
"""
