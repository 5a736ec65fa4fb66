"""Registration of a pair of scans given as one value."""

from scanlock import register


def register_pair(scans, **options):
    """Register the first of two scans to the second."""
    source, target = scans
    return register(source=source, target=target, **options)
