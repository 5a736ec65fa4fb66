"""How good poses, trajectories and maps are, in metres, radians and voxels."""
