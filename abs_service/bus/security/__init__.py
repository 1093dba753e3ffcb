"""Authentication and access control of the bus: mutual TLS, roles, and the log of both."""
