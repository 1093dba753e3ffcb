"""Shots that do not show the same board and rig as the rest: wrong ones, groups of them, changes at one time."""
