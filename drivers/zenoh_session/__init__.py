"""Sessions of zenoh, as the bus and a rig elsewhere open them: connection, callbacks, shared memory."""
