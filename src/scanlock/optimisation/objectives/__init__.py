"""Objectives of registration, with exact derivatives in the pose."""
