"""`python -m abs_client.web`."""

import sys

from abs_client.web.program import main

sys.exit(main())
