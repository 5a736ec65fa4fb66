"""Kernels of ground segmentation and clustering."""
