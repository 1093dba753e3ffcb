"""The connection to a rig: certificates, sessions, shared memory, and the messages as they arrive."""
