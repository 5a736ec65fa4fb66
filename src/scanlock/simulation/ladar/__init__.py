"""A range-imaging ladar on a pan/tilt platform of a vehicle, after Madhavan and Messina (2003).

What belongs here is special to range images; spinning lidars are in `scanlock.simulation.sensors`.
"""
