"""The tables of a configuration and of a calibration file, and what their values may be."""
