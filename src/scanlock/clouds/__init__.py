"""Point clouds, grids and nearest-neighbour searches.

`point_cloud` checks every array that enters the library. Gaussians and surfaces estimated from
points are in `scanlock.models`, and ground and clusters are in `scanlock.segmentation`.
"""
