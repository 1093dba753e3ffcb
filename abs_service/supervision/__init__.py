"""Child processes, and the life and end of `abs-service run`."""
