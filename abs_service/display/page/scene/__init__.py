"""The 3-D part of the page."""
