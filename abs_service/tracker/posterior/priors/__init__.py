"""Priors of shape, stretch and motion: negative log-densities of theta, without hand-tuned weights."""
