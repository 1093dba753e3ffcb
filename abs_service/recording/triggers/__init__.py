"""When recordings begin and end."""
