"""The union of the interchangeable solvers."""

from scanlock.optimisation.solvers.bfgs import Bfgs
from scanlock.optimisation.solvers.levenberg_marquardt import LevenbergMarquardt
from scanlock.optimisation.solvers.line_search_newton import LineSearchNewton
from scanlock.optimisation.solvers.newton import Newton

Solver = Newton | LineSearchNewton | LevenbergMarquardt | Bfgs
"""Settings of a solver that minimises any objective; `curvature` is the Hessian it needs."""
