"""Uncertainty, cross-validation and verdict of a solution."""
