"""File formats of scans, one file each, with the stations of a file and a registry.

A format has a reader (bytes to `ScanFile`) and a writer. What belongs to a data set rather than a
format is in `scanlock.io.datasets`.
"""
