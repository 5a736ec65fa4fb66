"""What we believe the points are: Gaussians, ground, clusters."""
