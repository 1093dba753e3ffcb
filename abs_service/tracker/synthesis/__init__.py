"""How deformed meshes are made comparable with images, one way per file; a rig file names them with `type`."""
