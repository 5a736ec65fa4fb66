"""Files of poses: one pose as text, JSON or NumPy array, and trajectories in KITTI and TUM format.

Poses that a format of scans holds are read in `scanlock.io.formats`. Trajectories with the times
and numbers of their scans belong to `scanlock.io.sequences`.
"""
