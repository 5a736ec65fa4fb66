"""What is minimised: scores of Gaussians with exact derivatives in the pose."""
