"""Measures the product: experiments, benchmarks, and scenes of their own; not part of the wheel."""
