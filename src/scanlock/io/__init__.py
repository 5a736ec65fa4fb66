"""The only code that sees a path: scans, poses, labels."""

from scanlock.io.atomic import atomic_file
from scanlock.io.formats import FORMATS, ScanFormat
from scanlock.io.scan_file import ScanFile
from scanlock.io.scans import read_scan, write_scan

__all__ = [
    "FORMATS",
    "ScanFile",
    "ScanFormat",
    "atomic_file",
    "read_scan",
    "write_scan",
]
