"""Experiments of the papers and comparisons on recorded scans, with one command each.

An experiment has scans, methods, claims of its paper and a page with the outcome. Error measures
are in `scanlock.evaluation`, figures in `scanlock.report`, and comparisons with other libraries in
``benchmarks``.
"""
