"""What the frames of a static sequence tell of a depth sensor's noise, before any model of it."""
