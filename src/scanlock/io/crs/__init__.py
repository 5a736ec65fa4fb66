"""Coordinate reference systems of files: EPSG codes, names and units.

Records of LAS files are parsed in `scanlock.io.formats.las`. Map projections are in no package:
coordinates are scaled to metres and never projected.
"""

from scanlock.io.crs.coordinate_system import CoordinateSystem

__all__ = ["CoordinateSystem"]
