"""Kernels on points: search trees, voxels, neighbourhoods."""
