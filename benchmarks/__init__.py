"""Benchmarks, run from the root of a clone: ``python -m benchmarks.speed.pairs --data FOLDER``.

``speed``, ``accuracy``, ``robustness``, ``uncertainty`` and ``io`` hold one module per command;
``_common`` holds the modules that several commands use. Every command takes ``--help`` and
``--json FILE``, which writes its tables with the commit and the machine. ``results`` holds the
files behind docs/benchmarks.md, and ``python -m benchmarks.report benchmarks/results`` writes the
tables of that page.

Behaviour that every commit must keep is tested in ``tests``. The experiments of the papers are in
`scanlock.experiments`.
"""
