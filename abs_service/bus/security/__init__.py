"""Who may connect to the bus, and what they may do then: mutual TLS, roles, and the log of both."""
