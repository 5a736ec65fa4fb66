"""Error measures of trajectories and maps, from poses and points alone.

What belongs here compares with a truth or summarises: trajectory errors, distances of closest
points, the crispness of a map, box plots. Files are read in `scanlock.io`, studies of many pairs
are run in `scanlock.pipelines`, and figures are drawn in `scanlock.report`.
"""
