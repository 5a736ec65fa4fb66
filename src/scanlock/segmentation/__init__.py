"""Segmentation of scans: ground, clusters, and Gaussians of the clusters.

What belongs here labels the points of one scan. Gaussians of voxels and points are in
`scanlock.models`, and the matching of clusters is in `scanlock.registration.search`.
"""
