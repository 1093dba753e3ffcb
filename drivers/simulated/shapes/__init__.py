"""Analytic shapes and their ray casters."""
