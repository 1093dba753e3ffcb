"""What is known of a sensor: projection, lens, pose, noise. Arrays in, arrays out; no I/O."""
