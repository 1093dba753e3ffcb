"""Benchmarks of kernels and frame rates."""
