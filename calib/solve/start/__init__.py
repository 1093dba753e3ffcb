"""Initial values of the bundle adjustment."""
