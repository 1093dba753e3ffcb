"""Devices: everything that yields frames, real, simulated or recorded."""
