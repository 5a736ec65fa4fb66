"""Simulated worlds and sensors with exact poses and labels."""
