"""How it is minimised: knows poses and objectives, never clouds."""
