"""Kernels on Gaussians: NDT and G-ICP scores with derivatives."""
