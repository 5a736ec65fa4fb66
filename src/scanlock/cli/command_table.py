"""The commands: where each one lives, and what help says of it beyond its options."""

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True, slots=True)
class Command:
    """One command, not imported before it is asked for."""

    path: str
    """Module and function."""

    help: str
    """What it does, in a line."""

    epilogue: str
    """What its help ends with."""


_READING = """\
Scans: .bin (KITTI), .npy, .npz, .pcd, .ply, .las, .laz, .txt, .xyz, .csv and more.
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
        help="Find the pose that carries one scan onto another, and whether to trust it.",
        epilogue=f"""\
Examples:
  scanlock register reference.bin scene.bin
  scanlock register reference.pcd scene.pcd -o pose.txt --picture pair.png
  scanlock register reference.las scene.las --initial guess.txt --json

Exit code: 0 for a pose to use unseen, 2 for one that is not to be trusted (the
reason is printed), 1 for wrong arguments or files.

{_READING}""",
    ),
    "segment": Command(
        path="scanlock.cli.commands.segment:segment",
        help="Find the ground and the clusters that stand on it.",
        epilogue=f"""\
Examples:
  scanlock segment scan.bin -o labels.npy
  scanlock segment scan.pcd -o coloured.ply --picture scan.png

Labels follow the rows of the scan: 0 ground, 1 and up clusters, -1 neither. In
.label files they are SemanticKITTI's: 49 ground, 99 with an instance number for
clusters, 0 neither. Scan files (.ply, .pcd, ...) get a further field.

{_READING}""",
    ),
    "info": Command(
        path="scanlock.cli.commands.info:info",
        help="Say what is in a scan file: fields, extent, oddities, and some guesses.",
        epilogue=f"""\
Examples:
  scanlock info scan.pcd
  scanlock info scan.bin --columns "x y z ring" --json

{_READING}""",
    ),
    "map": Command(
        path="scanlock.cli.commands.map:map_folder",
        help="Register a folder of scans one to the next, and lay them into one map.",
        epilogue="""\
Examples:
  scanlock map drive -o drive-map
  scanlock map 2011_09_26_drive_0005_sync -o map --every 10 --guess identity

Folders: scan files in natural order, KITTI raw and odometry, Ford Campus, or what
scanlock simulate wrote. An interrupt leaves the map up to there, and a kill its
poses.
Exit code: 2 if a pair is not to be trusted.
""",
    ),
    "evaluate": Command(
        path="scanlock.cli.commands.evaluate:evaluate",
        help="Compare a trajectory with the true one.",
        epilogue="""\
Examples:
  scanlock evaluate trajectory_tum.txt truth_tum.txt --picture both.png
  scanlock evaluate map/trajectory_tum.txt sequences/07
  scanlock evaluate poses.txt 07.txt --align all --json
""",
    ),
    "crispness": Command(
        path="scanlock.cli.commands.crispness:crispness",
        help="Count the voxels that a map fills: the fewer, the crisper.",
        epilogue=f"""\
Examples:
  scanlock crispness map.ply
  scanlock crispness icp.ply ndt.ply --width 0.2

Maps of the same scans can be compared, no others.

{_READING}""",
    ),
    "compare": Command(
        path="scanlock.cli.commands.compare:compare",
        help="Register pairs by several methods: errors, and how far away they may start.",
        epilogue=f"""\
Examples:
  scanlock compare reference.bin scene.bin --truth pose.txt
  scanlock compare drive --methods gicp sgc-ndt-d2d --every 10 --pairs 5
  scanlock compare drive --agree --starts 3 --distances 0 2 5 --angles 0 30

A folder's own poses (scanlock simulate, Ford Campus, KITTI odometry) are taken
for true, if it has any.

{_READING}""",
    ),
    "reproduce": Command(
        path="scanlock.cli.commands.reproduce:reproduce",
        help="Run an experiment of the SGC-NDT paper, and set our numbers beside its own.",
        epilogue="""\
Examples:
  scanlock reproduce forest
  scanlock reproduce urban --scans 10 -o /tmp/urban
  scanlock reproduce urban --data 2011_09_26_drive_0005_sync --poses poses.txt

Ctrl-C loses nothing: the same command goes on where it was.
""",
    ),
    "simulate": Command(
        path="scanlock.cli.commands.simulate:simulate",
        help="Make scans with exact poses and labels.",
        epilogue="""\
Examples:
  scanlock simulate street -o drive --scans 20 --every 10
  scanlock simulate forest -o forest --sensor os1-64 --format pcd
""",
    ),
    "settings": Command(
        path="scanlock.cli.commands.settings:settings",
        help="Print every setting of a method as TOML.",
        epilogue="""\
Examples:
  scanlock settings gicp
  scanlock settings sgc-ndt-p2d -o mine.toml
""",
    ),
    "warmup": Command(
        path="scanlock.cli.commands.warm_up:warm_up",
        help="Compile everything now, so that no later command has to.",
        epilogue="",
    ),
}
"""Every command by name, in the order of help."""
