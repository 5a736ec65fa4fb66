"""Simulated scenes: worlds with a track through them, and the terrain, roads and tracks they use.

Single objects are in `scanlock.simulation.objects`, and the motion along a track is in
`scanlock.simulation.drive`.
"""
