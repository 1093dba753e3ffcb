"""Capture: frames of a device, published on the bus."""
