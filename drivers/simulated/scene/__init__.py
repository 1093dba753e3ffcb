"""Simulated scenes: bodies, motion, texture."""
