"""Lens models, their inverses, and the ideal viewing directions of a camera's pixels."""
