"""Kernels of file formats: compression and decompression of bytes.

Kernels on the points that a file contains belong to `kernels.points`.
"""
