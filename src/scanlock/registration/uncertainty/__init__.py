"""Covariance of a pose."""
