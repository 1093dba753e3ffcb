"""Synthesis methods: deformed meshes projected or rendered into images, one per file; a rig file selects by `type`."""
