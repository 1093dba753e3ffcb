"""Experiments of the paper, E1 to E6."""
