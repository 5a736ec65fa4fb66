"""Modules that several benchmarks share: arguments, results, data sets, starts and contenders."""
