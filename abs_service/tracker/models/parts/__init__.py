"""Kernels and basis functions shared by several deformation models."""
