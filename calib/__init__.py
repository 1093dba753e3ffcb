"""Sensor model: projection, lens, pose, noise. Arrays in, arrays out; no I/O."""
