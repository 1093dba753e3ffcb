"""What the search minimises, one per file; a rig file names them with `type`."""
