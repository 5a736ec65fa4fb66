"""The solvers that can stand in for each other."""

from scanlock.optimisation.solvers.bfgs import Bfgs
from scanlock.optimisation.solvers.levenberg_marquardt import LevenbergMarquardt
from scanlock.optimisation.solvers.line_search_newton import LineSearchNewton
from scanlock.optimisation.solvers.newton import Newton

Solver = Newton | LineSearchNewton | LevenbergMarquardt | Bfgs
"""Settings that minimise any objective from a pose; `curvature` is the Hessian they want."""
