"""Simulated objects and the surfaces they are made of."""
