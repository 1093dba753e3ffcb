"""`python -m abs_client.ros2`."""

import sys

from abs_client.ros2.program import main

sys.exit(main())
