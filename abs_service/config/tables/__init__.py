"""The tables of a configuration and of a calibration file, and the allowed values."""
