"""Cameras of an OAK: intrinsics and extrinsics from its factory calibration."""
