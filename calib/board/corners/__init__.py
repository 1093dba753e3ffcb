"""Detection of board corners in one image."""
