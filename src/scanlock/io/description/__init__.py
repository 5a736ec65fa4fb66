"""Description of a scan file for ``scanlock info``: facts, and separately guesses.

Columns and row lengths that a reader infers belong to that reader, in `scanlock.io.formats`.
"""
