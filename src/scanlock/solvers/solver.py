"""The solvers that can stand in for each other."""

from scanlock.solvers.bfgs import Bfgs
from scanlock.solvers.levenberg_marquardt import LevenbergMarquardt
from scanlock.solvers.line_search_newton import LineSearchNewton
from scanlock.solvers.newton import Newton

Solver = Newton | LineSearchNewton | LevenbergMarquardt | Bfgs
"""Settings that minimise any objective from a pose; `curvature` is the Hessian they want."""
