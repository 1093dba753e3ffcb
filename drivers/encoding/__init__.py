"""Frames and sensor models as messages and MCAP files."""
