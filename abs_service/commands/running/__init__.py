"""Commands to a rig that runs already."""
