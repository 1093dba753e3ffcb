"""Experiments on the parts of the method, and on the method against others."""
