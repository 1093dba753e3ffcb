"""The commands of `abs-service`, one module each, and shared parts; `abs_service.cli` describes a command's module."""
