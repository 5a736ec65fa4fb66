"""The solvers that can stand in for each other."""

from scanlock.solvers.newton import Newton

Solver = Newton
"""Settings that minimise any objective from a pose; `curvature` is the Hessian they want."""
