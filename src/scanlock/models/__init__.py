"""Gaussian and surface models of point clouds."""
