"""Folders of image files as frames: public data sets and exports of other tools."""
