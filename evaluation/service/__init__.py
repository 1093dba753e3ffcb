"""Experiments on the running service and its drivers."""
