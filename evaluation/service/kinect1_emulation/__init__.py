"""Emulated Kinect v1: packets, control requests and USB device files for unmodified programs under umockdev."""
