"""Folders of image files as frames: other people's data sets, and what other tools export."""
