"""TOML text and files of method settings.

The settings themselves are the dataclasses of `scanlock.registration.methods` and below; this
folder only converts them, for any class whose fields have annotations that TOML can hold.
"""
