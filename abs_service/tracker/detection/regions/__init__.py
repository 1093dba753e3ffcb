"""Regions that select the object's pixels in the first depth image, one per file; a rig file selects by `type`."""
