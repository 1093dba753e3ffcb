"""Benchmarks of kernels and of parts of a frame."""
