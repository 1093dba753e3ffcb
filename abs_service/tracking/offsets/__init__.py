"""Offsets of the vertices from the model's surface, learnt over frames."""
