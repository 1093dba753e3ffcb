"""The commands of `abs-service`, one module each; see `abs_service.cli` for what such a module has."""
