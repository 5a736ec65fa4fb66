"""Ground, clusters, and the Gaussians of the clusters."""
