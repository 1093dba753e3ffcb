"""Shots in two groups that contradict each other: which shot belongs to which."""
