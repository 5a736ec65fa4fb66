"""Kernels of the simulated sensors: rays against surfaces and ground.

Kernels on the points of the simulated scans belong to `kernels.points`.
"""
