"""Calibration, times and scans of public data sets, one file each.

Readers of general formats belong to `scanlock.io.formats`; `scanlock.io.sequences` opens the
folders.
"""
