"""Commands that read a recording."""
