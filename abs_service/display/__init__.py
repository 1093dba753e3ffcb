"""Displays of a running rig: a live table, plain lines, JSON."""
