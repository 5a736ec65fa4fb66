"""Time and memory: whole registrations, stages, cold starts, threads and growth with scan size.

``pairs`` compares scanlock with other libraries, ``guard`` compares this commit with a recorded
one, ``cold_start`` measures fresh processes and compilation, ``threads`` measures the gain of a
second thread, and ``growth`` fits exponents over the number of points. Errors of the timed poses
belong to ``accuracy``.
"""
