"""Files: limits that hold before anything of another source is read or parsed; files that are written as a whole."""
