"""Lock 3D lidar scans together."""

__version__ = "0.1.0.dev0"
