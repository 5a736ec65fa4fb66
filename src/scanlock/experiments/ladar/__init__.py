"""Ladar experiment of Madhavan and Messina 2003: range images registered by adaptive ICP.

The simulated ladar is in `scanlock.simulation.ladar`, and ICP in
`scanlock.registration.methods.icp.icp`.
"""
