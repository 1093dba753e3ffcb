"""Checks of a rig file without its hardware: streams of its devices, and the bytes per second that they deliver."""
