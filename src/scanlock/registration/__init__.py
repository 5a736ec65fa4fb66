"""Registration of two scans: preparation, alignment, verification and the result.

This folder holds the public functions and the registry of methods. Methods are in `methods`, the
global search in `search`, the test of a pose in `verification`, covariances in `uncertainty`, and
TOML files in `settings`. Registration of many scans belongs to `scanlock.pipelines`.
"""
