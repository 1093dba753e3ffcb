"""Studies behind the defaults and the documentation."""
