"""Readers, writers and commands under damaged files (``fuzz_readers``) and ``interrupts``."""
