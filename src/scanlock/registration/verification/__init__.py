"""Verification of a pose: features of each scan, metrics, probability and status."""
