"""Simulated objects, such as houses, plants and cars, and the surfaces that they consist of.

Every object is generated in its own frame; `scanlock.simulation.scenes` places objects in a world.
"""
