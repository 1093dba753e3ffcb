"""What a command found out, for people and programs: verdicts, tables and pictures on one page, and as JSON."""
