"""Segmentation of scans: ground, clusters, and Gaussians of the clusters."""
