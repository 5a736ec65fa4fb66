"""Modules that several benchmarks use: arguments, results, data sets, starts and contenders.

A module that one command uses is beside that command. Error measures are in `scanlock.evaluation`.
"""
