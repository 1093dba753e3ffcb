"""Experiments on sensors and their images: several sensors, mosaics, warped input, real recordings."""
