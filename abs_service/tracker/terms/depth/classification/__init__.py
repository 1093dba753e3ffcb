"""Pixels of a depth image: object, occluder, hole, background, end of the field of view; distance from the outline."""
