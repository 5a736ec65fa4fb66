"""Global search: pose hypotheses from two scans, without an initial pose."""
