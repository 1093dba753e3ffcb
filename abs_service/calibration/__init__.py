"""Around the calibration: what it reads, and what it writes for people and programs."""
