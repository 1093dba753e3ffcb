"""Rigs that come with the service, as TOML files."""
