"""Searches behind ask and tell, one per file; a rig file names them with `type`. `cma.py` is the one to copy."""
