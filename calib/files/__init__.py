"""Files from other sources: limits that hold before anything is read or parsed."""
