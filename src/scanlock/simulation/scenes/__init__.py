"""Simulated scenes: streets, forests, rugged terrain and look-alikes."""
