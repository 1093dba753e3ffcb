"""Pixels of one thing in a depth image: connected surfaces, grown from seeds."""
