"""Measures the product: experiments, benchmarks, and scenes of their own; not part of the wheel."""

import os

from abs_service.cli import THREADS
from abs_service.supervision.process_setup.process_tuning import keep_freed_memory

# BLAS reads these when NumPy is first imported. Several threads made the times up to 2.5 times those of the service.
for _variable in THREADS:
    os.environ.setdefault(_variable, "1")

# As processes of the service do; else the system clears memory for each image anew.
keep_freed_memory()
