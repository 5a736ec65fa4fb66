"""Table of the commands: their functions and help texts."""

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True, slots=True)
class Command:
    """One command; its module is imported when it runs."""

    path: str
    """Module and function."""

    help: str
    """Summary, one line."""

    epilogue: str
    """End of its help: examples and exit codes."""


_READING = """\
Scans: .bin (KITTI), .npy, .pcd, .ply, .las, .laz, .e57, .ptx, .txt, .csv and more;
scan.e57#2 is the second station of a file.
"""

COMMANDS = {
    "demo": Command(
        path="scanlock.cli.commands.demo:demo",
        help="Register two simulated scans of a street and compare with the exact pose.",
        epilogue="""\
Examples:
  scanlock demo
  scanlock demo -o /tmp/demo --seed 7
""",
    ),
    "register": Command(
        path="scanlock.cli.commands.register:register",
        help="Estimate and verify the pose between two scans.",
        epilogue=f"""\
Examples:
  scanlock register source.bin target.bin
  scanlock register source.pcd target.pcd -o pose.txt --picture pair.png
  scanlock register epoch2.laz epoch1.laz --aligned moved.laz --merged both.ply
  scanlock register source.las target.las --initial guess.txt --json

Exit code: 0 if the pose is verified, 2 if it is not (the reason is printed),
1 for wrong arguments or files.

{_READING}""",
    ),
    "register-many": Command(
        path="scanlock.cli.commands.register_many:register_many",
        help="Register every pair of a table; also as scanlock register --pairs.",
        epilogue=f"""\
Examples:
  scanlock register-many list.csv -o results.csv
  scanlock register-many list.csv -o results.csv --resume
  scanlock register-many list.csv -o results.jsonl --scheduler tcp://host:8786

The same as scanlock register --pairs list.csv. A scan that cannot be read
becomes a row with the status error.
Exit code: 0 if every pose is verified, 2 if not.

{_READING}""",
    ),
    "apply": Command(
        path="scanlock.cli.commands.apply:apply",
        help="Move a cloud by a pose, with all its fields.",
        epilogue=f"""\
Examples:
  scanlock apply pose.txt source.laz -o moved.laz
  scanlock apply pose.json target.ply --inverse -o target_in_source.ply

Normals turn with the points; colours, intensities and all other fields stay.

{_READING}""",
    ),
    "segment": Command(
        path="scanlock.cli.commands.segment:segment",
        help="Find the ground and the clusters above it.",
        epilogue=f"""\
Examples:
  scanlock segment scan.bin -o labels.npy
  scanlock segment scan.pcd -o coloured.ply --picture scan.png
  scanlock segment flight.laz -o classified.laz

Labels have one row per point: 0 ground, 1 and up clusters, -1 neither. In .label
files they are SemanticKITTI's: 49 ground, 99 with an instance number for
clusters, 0 neither. Scan files get a label field; .ply and .pcd also colours, and
.las and .laz the classes 2 for ground and 1 for all others.

{_READING}""",
    ),
    "info": Command(
        path="scanlock.cli.commands.info:info",
        help="Describe a scan file: format, fields, extent, coordinate system and unit.",
        epilogue=f"""\
Examples:
  scanlock info scan.pcd
  scanlock info scan.bin --columns "x y z ring" --json
  scanlock info millimetres.ply --scale 0.001

{_READING}""",
    ),
    "map": Command(
        path="scanlock.cli.commands.map:map_folder",
        help="Register consecutive scans of a folder and build one map.",
        epilogue="""\
Examples:
  scanlock map drive -o drive-map
  scanlock map 2011_09_26_drive_0005_sync -o map --every 10 --guess identity
  scanlock map drive -o drive-map --resume
  scanlock map site.e57 -o site-map
  scanlock map drive -o icp-map --method icp --set voxel_size=0.3

Folders: scan files in natural order, KITTI raw and odometry, Ford Campus, or the
output of scanlock simulate. The stations of an E57 or PTX file are mapped in its
order. After an interrupt the map so far is written.
Exit code: 2 if a pair is not verified.
""",
    ),
    "evaluate": Command(
        path="scanlock.cli.commands.evaluate:evaluate",
        help="Compute the errors of a trajectory against ground truth.",
        epilogue="""\
Examples:
  scanlock evaluate trajectory_tum.txt truth_tum.txt --picture both.png
  scanlock evaluate map/trajectory_tum.txt sequences/07
  scanlock evaluate map/trajectory_kitti.txt poses/07.txt --calib calib.txt
  scanlock evaluate poses.txt 07.txt --align all --delta 100 --unit m --json

KITTI's poses of the camera are recognised and converted to the laser. A map of
some scans is matched with the truth of all by the scan numbers beside it.
""",
    ),
    "crispness": Command(
        path="scanlock.cli.commands.crispness:crispness",
        help="Count the voxels that a map fills; fewer is crisper.",
        epilogue=f"""\
Examples:
  scanlock crispness map.ply
  scanlock crispness icp.ply ndt.ply --voxel-size 0.2

Only maps of the same scans are comparable. Maps of different numbers of scans are
refused where they have the field of scanlock map.

{_READING}""",
    ),
    "compare": Command(
        path="scanlock.cli.commands.compare:compare",
        help="Compare methods on pairs of scans: errors and basins of convergence.",
        epilogue=f"""\
Examples:
  scanlock compare first.bin second.bin --truth second_in_first.txt
  scanlock compare drive --methods gicp sgc-ndt-d2d --every 10 --pairs 5
  scanlock compare drive --agree --starts 3 --distances 0 2 5 --angles 0 30

Ground truth: the poses in the folder (scanlock simulate, Ford Campus, KITTI
odometry), if it has some. After Ctrl-C the same command continues.

{_READING}""",
    ),
    "reproduce": Command(
        path="scanlock.cli.commands.reproduce:reproduce",
        help="Reproduce an experiment of the papers, with the published numbers beside.",
        epilogue="""\
Examples:
  scanlock reproduce forest
  scanlock reproduce urban --scans 10 -o /tmp/urban
  scanlock reproduce urban --data 2011_09_26_drive_0005_sync --poses poses.txt

After Ctrl-C the same command continues.
""",
    ),
    "simulate": Command(
        path="scanlock.cli.commands.simulate:simulate",
        help="Simulate scans with exact poses and labels.",
        epilogue="""\
Examples:
  scanlock simulate street -o drive --scans 20 --every 10
  scanlock simulate forest -o forest --sensor os1-64 --format pcd
""",
    ),
    "settings": Command(
        path="scanlock.cli.commands.settings:settings",
        help="Print the settings of a method as TOML.",
        epilogue="""\
Examples:
  scanlock settings gicp
  scanlock settings sgc-ndt-p2d --all -o mine.toml

register, compare and map take the file with --settings, and changes of single
settings as --set voxel_size=0.5.
""",
    ),
    "warmup": Command(
        path="scanlock.cli.commands.warm_up:warm_up",
        help="Compile all kernels now, so that later commands start at once.",
        epilogue="",
    ),
}
"""Every command by name, in the order of help."""
