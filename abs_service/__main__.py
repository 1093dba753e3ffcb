"""`python -m abs_service` is `abs-service`."""

import sys

from abs_service.cli import main

sys.exit(main())
