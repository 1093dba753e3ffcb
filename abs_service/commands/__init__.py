"""The commands of `abs-service`, one module each, and what they share; see `abs_service.cli` for what a command has."""
