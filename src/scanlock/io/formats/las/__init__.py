"""LAS and LAZ, the formats of surveying, through laspy (the optional extra ``las``).

Units and codes of coordinate reference systems belong to `scanlock.io.crs`.
"""
