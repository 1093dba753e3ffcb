"""Pictures in files: what a tracker would track, and the fit of a bending stiffness."""
