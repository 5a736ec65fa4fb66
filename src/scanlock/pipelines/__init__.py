"""Registration of many scans: odometry along a sequence, and studies of pairs.

What belongs here loops over `scanlock.registration.register` and yields results one at a time. A
single pair is registered in `scanlock.registration`; the papers' experiments and their printed
tables are in `scanlock.experiments`.
"""
