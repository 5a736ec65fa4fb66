"""Readers and writers under damaged files (``fuzz_readers``), and commands under ``interrupts``.

Registration of unusable points belongs to ``robustness``.
"""
