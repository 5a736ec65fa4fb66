"""Simulated worlds and sensors, with exact poses and labels.

- ``scan_pair("street", "hdl_64e", seed=1)`` returns two scans and the exact pose between them.
- ``SimulatedSequence(world=..., sensor=..., drive=..., seed=1)`` has the scans of a whole drive.
- `simulate_scan` scans any `World`, of `boxes`, `cones`, `ellipsoids`, `discs` and `triangles` on a
  `HeightField`.
- ``ladar_run(seed=1)`` returns range images of a ladar on an off-road vehicle.
- `scanlock.simulation.scenes.look_alikes` has worlds in which poses are ambiguous, and
  `scanlock.simulation.scenes.repeating` worlds in which only loose things distinguish poses.

The same seed gives the same bytes. What belongs here generates worlds and scans of them; errors
against the exact poses are computed in `scanlock.evaluation`.
"""

from scanlock.simulation.drive import CAR, ROBOT, Carrier, Drive, drive_along
from scanlock.simulation.ladar.mount import PanTiltMount, TiltSweep
from scanlock.simulation.ladar.scan import LadarScan, simulate_frame
from scanlock.simulation.ladar.sensor import FacetLadar, points_from_ranges, ranges_from_points
from scanlock.simulation.ladar.sequence import AHEAD_AND_DOWN, LadarSequence, ladar_run
from scanlock.simulation.motion import carried, screw, twist_between
from scanlock.simulation.objects.mover import Mover
from scanlock.simulation.objects.shapes import boxes, cones, discs, ellipsoids, triangles
from scanlock.simulation.objects.surface_class import SurfaceClass
from scanlock.simulation.objects.surfaces import Surfaces
from scanlock.simulation.rig import Mount, Rig, simulate_rig
from scanlock.simulation.scan import SimulatedScan, simulate_scan
from scanlock.simulation.scenes.forests import forest, forest_walk
from scanlock.simulation.scenes.rugged import XUV, rugged, rugged_drive
from scanlock.simulation.scenes.scene import Scene
from scanlock.simulation.scenes.streets import street, street_drive
from scanlock.simulation.sensor_models import (
    SENSORS,
    hdl_32e,
    hdl_64e,
    livox_avia,
    os0_128,
    os1_64,
    os1_128,
    vlp_16,
    vlp_32c,
)
from scanlock.simulation.sensors import Sensor
from scanlock.simulation.sequence import (
    SCENES,
    SimulatedPair,
    SimulatedSequence,
    drive_through,
    scan_pair,
)
from scanlock.simulation.terrain.height_field import HeightField
from scanlock.simulation.terrain.track import Track
from scanlock.simulation.world import RayHits, World

__all__ = [
    "AHEAD_AND_DOWN",
    "CAR",
    "ROBOT",
    "SCENES",
    "SENSORS",
    "XUV",
    "Carrier",
    "Drive",
    "FacetLadar",
    "HeightField",
    "LadarScan",
    "LadarSequence",
    "Mount",
    "Mover",
    "PanTiltMount",
    "RayHits",
    "Rig",
    "Scene",
    "Sensor",
    "SimulatedPair",
    "SimulatedScan",
    "SimulatedSequence",
    "SurfaceClass",
    "Surfaces",
    "TiltSweep",
    "Track",
    "World",
    "boxes",
    "carried",
    "cones",
    "discs",
    "drive_along",
    "drive_through",
    "ellipsoids",
    "forest",
    "forest_walk",
    "hdl_32e",
    "hdl_64e",
    "ladar_run",
    "livox_avia",
    "os0_128",
    "os1_64",
    "os1_128",
    "points_from_ranges",
    "ranges_from_points",
    "rugged",
    "rugged_drive",
    "scan_pair",
    "screw",
    "simulate_frame",
    "simulate_rig",
    "simulate_scan",
    "street",
    "street_drive",
    "triangles",
    "twist_between",
    "vlp_16",
    "vlp_32c",
]
