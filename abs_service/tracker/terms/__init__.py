"""One sensor's part of an objective, one kind of sensor per file."""
