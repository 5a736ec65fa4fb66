"""Objectives of registration, with exact derivatives in the pose."""

from scanlock._lazy import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
