"""From a device to frames on the bus."""
