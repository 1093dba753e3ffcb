"""Measures the product: experiments, benchmarks, and scenes of their own; not part of the wheel."""

import os

from abs_service.cli import THREADS

# BLAS reads these when NumPy is first imported. Several threads made the times up to 2.5 times those of the service.
for _variable in THREADS:
    os.environ.setdefault(_variable, "1")
