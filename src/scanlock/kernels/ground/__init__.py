"""Kernels of ground segmentation and clustering, on one scan.

Kernels on points that know neither ground nor clusters belong to `kernels.points`.
"""
