"""Point clouds, grids and nearest-neighbour searches."""
