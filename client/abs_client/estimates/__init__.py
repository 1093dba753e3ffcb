"""Estimates of a tracker, from their messages to the newest one that is whole."""
