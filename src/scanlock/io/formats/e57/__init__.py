"""E57, the exchange format of terrestrial scanners: stations with their poses.

Points are read and written through pye57 (the optional extra ``e57``); poses are edited in the
file itself. What other formats share is in `scanlock.io.formats`.
"""
