"""Noise models of images and light barriers, one per file; a rig file names them with `type`."""
