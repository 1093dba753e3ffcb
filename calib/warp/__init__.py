"""Input warping (section 3.2): measurements of one sensor in the view of another camera."""
