"""Pairing: frame sets from frames, and observations in SI units from these."""
