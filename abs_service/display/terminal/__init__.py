"""The terminal: a live table, plain lines, JSON, the journal, and what a device or a recording is."""
