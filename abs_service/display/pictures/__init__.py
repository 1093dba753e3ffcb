"""Pictures in files: the preview of a tracker, and the fit of a bending stiffness."""
