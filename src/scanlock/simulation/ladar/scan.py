"""Simulated frame of a facet ladar on a vehicle, with exact poses and labels."""

from dataclasses import dataclass

import numpy as np

from scanlock.arrays import Matrix, Points, Vector, frozen
from scanlock.geometry.pose import Pose
from scanlock.simulation.ladar.mount import PanTiltMount
from scanlock.simulation.ladar.sensor import FacetLadar, points_from_ranges
from scanlock.simulation.motion import checked_twist, screw
from scanlock.simulation.objects.surface_class import SurfaceClass
from scanlock.simulation.scan import SimulatedScan
from scanlock.simulation.world import World

_PLANTS = (SurfaceClass.FOLIAGE, SurfaceClass.SHRUB, SurfaceClass.GRASS)


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class LadarScan(SimulatedScan):
    """One frame of a ladar, as a range image and as points in the frame of the vehicle.

    The sensor frame of `SimulatedScan` is the frame of the vehicle here: `points` are in it, in
    the order of the image, row by row; `pose` is ``world_from_vehicle`` at the middle of the frame,
    and `twist` the velocity of the vehicle. `rings` are image rows, and `period` is the duration of
    the frame.

    Attributes
    ----------
    ranges : (r, c) [m]
        Readings of the ladar; NaN for lost returns.
    pan, tilt : float [rad]
        Readings of the platform, constant during the frame.
    """

    ranges: Matrix
    pan: float
    tilt: float

    def __post_init__(self) -> None:
        SimulatedScan.__post_init__(self)
        frozen(self.ranges)


def simulate_frame(
    world: World,
    ladar: FacetLadar,
    mount: PanTiltMount,
    pose: Pose,
    rng: np.random.Generator,
    *,
    pan: float = 0.0,
    tilt: float = 0.0,
    time: float = 0.0,
    twist: Vector | None = None,
) -> LadarScan:
    """Simulate one frame of a ladar on a vehicle.

    Parameters
    ----------
    world : World
    ladar : FacetLadar
    mount : PanTiltMount
        Mount of the ladar on the vehicle.
    pose : Pose
        ``world_from_vehicle`` at the middle of the frame.
    rng : Generator
        Source of range noise and lost returns. The number of draws does not depend on the world.
    pan, tilt : float [rad]
        Readings of the platform.
    time : float [s]
        Time of the middle of the frame, for moving objects.
    twist : (6,) [m/s, rad/s], optional
        Constant velocity of the vehicle in its own frame, translation first; zero by default.

    Returns
    -------
    LadarScan

    Raises
    ------
    InvalidInput
        A twist of another shape, or not finite; a reading beyond the limits of the platform.
    """
    twist = checked_twist(twist)
    firing = np.repeat(ladar.firing_times(), ladar.rows_per_facet, axis=0).ravel()
    delays = firing - 0.5 * ladar.frame_time
    origins, directions = _rays(ladar, mount.vehicle_from_sensor(pan, tilt), pose, twist, delays)
    hits = world.cast(origins, directions, time, delays, ladar.max_range)

    noise = rng.standard_normal(len(firing)) * ladar.range_noise
    chance = ladar.detection(hits.distances, hits.cosines) * (1.0 - hits.losses)
    chance = chance * np.where(np.isin(hits.labels, _PLANTS), 1.0 - ladar.plant_loss, 1.0)
    working = rng.random(ladar.facets) >= ladar.facet_loss
    chance = chance * np.repeat(working, ladar.rows_per_facet * ladar.columns)
    readings = ladar.readings(hits.distances + noise)
    detected = (rng.random(len(firing)) < chance) & (readings > 0.0)
    ranges = np.where(detected, readings, np.nan).reshape(ladar.rows, ladar.columns)
    points = points_from_ranges(ranges, ladar, mount, pan=pan, tilt=tilt)
    return LadarScan(
        points=points.reshape(-1, 3)[detected],
        labels=hits.labels[detected],
        objects=hits.objects[detected],
        rings=np.flatnonzero(detected) // ladar.columns,
        times=firing[detected],
        pose=pose,
        twist=twist,
        time=time,
        period=ladar.frame_time,
        ranges=ranges,
        pan=pan,
        tilt=tilt,
    )


def _rays(
    ladar: FacetLadar, vehicle_from_sensor: Pose, pose: Pose, twist: Vector, delays: Vector
) -> tuple[Points, Points]:
    """Return origins [m] and directions of all beams in the world, at their times of firing."""
    rotations, translations = screw(twist, delays)
    orientations = pose.rotation @ rotations
    beams = ladar.directions().reshape(-1, 3) @ vehicle_from_sensor.rotation.T
    origins = pose.apply(translations) + orientations @ vehicle_from_sensor.translation
    return origins, np.einsum("nij,nj->ni", orientations, beams)
