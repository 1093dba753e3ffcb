"""Kernels are compiled, or loaded from the cache, before the first real frame."""
