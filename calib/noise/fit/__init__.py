"""Fitting of noise models, and families of functions that several models share."""
