"""What people see of a rig: the terminal, a page in the browser, pictures."""
