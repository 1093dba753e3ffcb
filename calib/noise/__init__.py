"""Noise models of distances, one per file, and of images in `images`; a rig file names them with `type`."""
