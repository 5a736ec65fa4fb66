"""Point clouds and the grids laid over them."""
