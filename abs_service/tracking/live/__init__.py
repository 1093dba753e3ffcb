"""A session in a process of a rig: it takes frame sets from the bus and publishes estimates and health."""
