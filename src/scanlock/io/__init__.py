"""Files: scans, poses, labels and sequences of scans.

This folder holds the contents of a scan file, its columns, and the reading and writing of scans,
stations and labels, in metres. Formats are in `formats`, poses and trajectories in `poses`, folders
of scans in `sequences`, and the description for ``scanlock info`` in `description`. Points are
checked in `scanlock.clouds`, and settings files are read in `scanlock.registration.settings`.
"""

from scanlock.io.atomic import atomic_file
from scanlock.io.crs import CoordinateSystem
from scanlock.io.description.describe import describe_scan
from scanlock.io.description.scan_description import ScanDescription
from scanlock.io.formats.e57.poses import write_e57_poses
from scanlock.io.formats.registry import FORMATS, ScanFormat
from scanlock.io.labels import read_labels, write_labels
from scanlock.io.poses.pose_files import read_pose, read_pose_matrix, write_pose
from scanlock.io.poses.trajectory_files import (
    read_kitti_poses,
    read_numbered_poses,
    read_trajectory,
    read_tum_poses,
    write_kitti_poses,
    write_tum_poses,
)
from scanlock.io.scan_file import ScanFile
from scanlock.io.scans import read_scan, write_scan
from scanlock.io.sequences.open_sequence import open_sequence
from scanlock.io.sequences.scan_sequence import ScanSequence
from scanlock.io.station_files import read_scans, write_scans
from scanlock.io.transform import merge_scans, transform_scan

__all__ = [
    "FORMATS",
    "CoordinateSystem",
    "ScanDescription",
    "ScanFile",
    "ScanFormat",
    "ScanSequence",
    "atomic_file",
    "describe_scan",
    "merge_scans",
    "open_sequence",
    "read_kitti_poses",
    "read_labels",
    "read_numbered_poses",
    "read_pose",
    "read_pose_matrix",
    "read_scan",
    "read_scans",
    "read_trajectory",
    "read_tum_poses",
    "transform_scan",
    "write_e57_poses",
    "write_kitti_poses",
    "write_labels",
    "write_pose",
    "write_scan",
    "write_scans",
    "write_tum_poses",
]
