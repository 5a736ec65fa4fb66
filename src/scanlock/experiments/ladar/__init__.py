"""Ladar experiment of Madhavan and Messina 2003: range images registered by adaptive ICP."""
