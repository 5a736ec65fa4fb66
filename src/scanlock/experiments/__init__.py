"""Experiments of the papers and comparisons on recorded scans, with one command each."""
