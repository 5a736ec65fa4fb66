"""Register 3D lidar scans.

``scanlock.register(source=..., target=...)`` estimates the pose between two scans and verifies it.
``scanlock.segment(points)`` finds the ground and the clusters of one. The public names are in
``__init__.pyi``; each is imported when it is first used, because Numba and SciPy take a second.

Modules beside this file are used by all packages: errors, array types, threads, timings and
interrupts. Everything about scans is in a package; ``docs/architecture.md`` lists them.
"""

from scanlock._lazy import attach

__version__ = "0.1.0.dev0"

__getattr__, __dir__, __all__ = attach(__name__, __file__)
