"""Worlds that repeat: equal bays, floors, houses and rows, with loose things that differ.

Every function takes a `Visit`: its seed determines the structure; its part (a floor, a hall, a
section of a street), number and changed fraction determine the loose things. ``things=0`` leaves
only the structure. Worlds without loose things, which have no correct answer at all, are in
`scanlock.simulation.scenes.look_alikes`.
"""

from scanlock.simulation.scenes.repeating.avenues import avenue, orchard, vineyard
from scanlock.simulation.scenes.repeating.car_parks import car_park
from scanlock.simulation.scenes.repeating.colonnades import colonnade, platform
from scanlock.simulation.scenes.repeating.halls import container_yard, warehouse
from scanlock.simulation.scenes.repeating.houses import crossroads, terraced_street
from scanlock.simulation.scenes.repeating.offices import office_floor
from scanlock.simulation.scenes.repeating.repeating_world import RepeatingWorld
from scanlock.simulation.scenes.repeating.rooms import furnished_room, stairwell
from scanlock.simulation.scenes.repeating.tunnels import ringed_tunnel
from scanlock.simulation.scenes.repeating.visit import Visit

REPEATING = {
    "car_park": car_park,
    "warehouse": warehouse,
    "colonnade": colonnade,
    "avenue": avenue,
    "orchard": orchard,
    "vineyard": vineyard,
    "ringed_tunnel": ringed_tunnel,
    "terraced_street": terraced_street,
    "crossroads": crossroads,
    "office_floor": office_floor,
    "furnished_room": furnished_room,
    "stairwell": stairwell,
    "platform": platform,
    "container_yard": container_yard,
}
"""Functions that generate the worlds, by name."""

__all__ = [
    "REPEATING",
    "RepeatingWorld",
    "Visit",
    "avenue",
    "car_park",
    "colonnade",
    "container_yard",
    "crossroads",
    "furnished_room",
    "office_floor",
    "orchard",
    "platform",
    "ringed_tunnel",
    "stairwell",
    "terraced_street",
    "vineyard",
    "warehouse",
]
