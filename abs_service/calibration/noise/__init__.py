"""Measurement, selection and report of noise models."""
