"""Optimisation over poses: solvers and the objectives that they minimise."""
