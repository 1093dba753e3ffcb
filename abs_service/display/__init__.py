"""What a person, or a script, sees of a running rig: a live table, plain lines, or JSON."""
