"""Solvers over poses, with their stopping criteria and line searches.

Solvers know an objective by the protocol in `problem` only, and no point clouds. Objectives are in
`scanlock.optimisation.objectives`.
"""

from scanlock._lazy import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
