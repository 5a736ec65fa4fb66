"""Solvers over poses; they know objectives by a protocol, and no point clouds."""
