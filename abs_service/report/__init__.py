"""Reports of commands: verdicts, tables and pictures on one HTML page, and as JSON."""
