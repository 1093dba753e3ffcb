"""Begin and end of recordings."""
