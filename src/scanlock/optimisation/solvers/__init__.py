"""Solvers over poses; they know objectives by a protocol, and no point clouds."""

from scanlock._lazy import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
