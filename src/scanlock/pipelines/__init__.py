"""Scans in, poses out: sequences, maps, studies of many pairs."""
