"""Input warping (section 3.2): what one sensor measured, as another camera would have it."""
