"""Folders of scans in temporal order, and trajectories with the times and numbers of their scans.

`scan_sequence`
    `ScanSequence`: the files of the scans, with times, numbers and poses.
`open_sequence`
    The supported layouts: plain files, KITTI, Ford Campus, ``scanlock simulate``.
`scan_folders`
    The scan files of a folder in natural order, and hints where there are none.
`trajectory`
    `Trajectory`: poses with all that their surroundings tell about their rows.

Files of poses alone are read in `scanlock.io.poses`, and files of the data sets in
`scanlock.io.datasets`.
"""
