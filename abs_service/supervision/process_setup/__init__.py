"""Set-up of a process itself: its kernel cache, log format, thread switching and standard files."""
