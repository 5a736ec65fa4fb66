"""Kernels on Gaussians: NDT and G-ICP objectives with derivatives, and operations on covariances.

Kernels that compare the Gaussians of two scans at a given pose, without derivatives, belong to
`kernels.verification`.
"""
