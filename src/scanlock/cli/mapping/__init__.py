"""Work of ``scanlock map``: scans with their fields, registration, results and their files.

Odometry without files is in `scanlock.pipelines.odometry`; the options of the command are in
`scanlock.cli.commands.map`.
"""
