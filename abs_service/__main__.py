"""`python -m abs_service` is `abs-service`."""

from abs_service.cli import program

program()
