"""Ways to say which part of the first depth image is the object, one per file; a rig file names them with `type`."""
