"""Terrain and the tracks on it: height fields, closed tracks, random smooth functions.

Roads and the ground of a scene are in `scanlock.simulation.scenes`.
"""
