"""Training of the pose prior that the package contains."""
