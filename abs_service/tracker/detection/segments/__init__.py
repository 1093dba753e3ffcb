"""Segments of a depth image: connected surfaces, grown from seeds."""
