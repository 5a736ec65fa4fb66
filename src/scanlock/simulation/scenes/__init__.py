"""Simulated scenes: worlds with a track through them, and the roads and sites they use.

Single objects are in `scanlock.simulation.objects`, height fields and tracks in
`scanlock.simulation.terrain`, and the motion along a track is in `scanlock.simulation.drive`.
"""
