"""The only code that sees a path: scans, poses, labels."""
