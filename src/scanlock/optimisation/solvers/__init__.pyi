from scanlock.optimisation.solvers.bfgs import Bfgs as Bfgs
from scanlock.optimisation.solvers.criteria import ConvergenceCriteria as ConvergenceCriteria
from scanlock.optimisation.solvers.criteria import StopReason as StopReason
from scanlock.optimisation.solvers.gauss_newton import gauss_newton_step as gauss_newton_step
from scanlock.optimisation.solvers.levenberg_marquardt import (
    LevenbergMarquardt as LevenbergMarquardt,
)
from scanlock.optimisation.solvers.line_search import Armijo as Armijo
from scanlock.optimisation.solvers.line_search import StrongWolfe as StrongWolfe
from scanlock.optimisation.solvers.line_search_newton import LineSearchNewton as LineSearchNewton
from scanlock.optimisation.solvers.more_thuente import MoreThuente as MoreThuente
from scanlock.optimisation.solvers.newton import Newton as Newton
from scanlock.optimisation.solvers.notes import LengthNote as LengthNote
from scanlock.optimisation.solvers.problem import Objective as Objective
from scanlock.optimisation.solvers.problem import Quadratic as Quadratic
from scanlock.optimisation.solvers.problem import Separable as Separable
from scanlock.optimisation.solvers.solution import Iteration as Iteration
from scanlock.optimisation.solvers.solution import Solution as Solution
from scanlock.optimisation.solvers.staged import minimise_staged as minimise_staged

__all__: list[str]
