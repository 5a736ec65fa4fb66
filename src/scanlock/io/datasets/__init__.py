"""Calibration, times and scans of public data sets, one file each.

Their scans in general formats are read by `scanlock.io.formats`; `scanlock.io.sequences` opens the
folders.
"""
