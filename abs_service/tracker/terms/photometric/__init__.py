"""Terms of sensors that deliver pictures."""
