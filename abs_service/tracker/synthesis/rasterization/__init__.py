"""Triangle rasterisation into a z-buffer."""
