"""The terminal: a live table, plain lines, JSON, the journal, and descriptions of devices and recordings."""
