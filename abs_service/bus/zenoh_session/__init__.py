"""What a session of zenoh needs: connection, callbacks, shared memory and its pools."""
