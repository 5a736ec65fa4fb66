"""TOML text and files of method settings.

This folder converts any dataclass whose fields have annotations that TOML can hold. The settings
themselves belong to `scanlock.registration.methods` and the packages below.
"""
