"""Kernels and bases that several deformation models share."""
