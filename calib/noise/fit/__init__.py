"""Fitting of noise models, and function families that several models share."""
