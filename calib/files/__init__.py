"""Files that somebody else wrote: limits that hold before anything is read or parsed."""
