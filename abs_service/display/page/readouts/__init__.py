"""State of a rig in words, numbers and curves."""
