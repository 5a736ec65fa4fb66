"""File formats of single scans, one file each, and their registry.

A format has a reader (bytes to `ScanFile`) and a writer. What belongs to a data set rather than a
format is in `scanlock.io.datasets`.
"""
