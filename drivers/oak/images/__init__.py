"""Images of an OAK, from depthai's queues and from its recordings."""
