"""Parameters of a calibration: values, lenses, and the vector of those that are free."""
