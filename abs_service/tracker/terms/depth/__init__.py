"""The term of a depth sensor: distances, visibility, outline."""
