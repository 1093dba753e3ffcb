"""Parts of a session of zenoh: connection, callbacks, shared memory and its pools."""
