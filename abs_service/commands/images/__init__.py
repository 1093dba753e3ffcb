"""The import of images and of other programs' recordings."""
