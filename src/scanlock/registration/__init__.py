"""Compositions: each file reads like its paper's pseudo-code."""
