"""Terms of imaging sensors: colour, grey, Bayer mosaic, intensity."""
