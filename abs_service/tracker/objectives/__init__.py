"""Objectives: cost functions of the search, one per file; a rig file selects one by `type`."""
