"""Deformation models, one per file; a rig file names them with `type`."""
