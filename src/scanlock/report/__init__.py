"""Static figures, tables and coloured scans of results; figures need the extra ``figures``.

The numbers that are shown are computed in `scanlock.evaluation` and `scanlock.registration`.
"""
