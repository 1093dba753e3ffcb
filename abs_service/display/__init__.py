"""Displays of a rig: terminal, page in the browser, pictures."""
