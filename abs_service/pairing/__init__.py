"""From frames to frame sets to observations in SI units."""
