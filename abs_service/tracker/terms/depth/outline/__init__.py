"""The end of the surface: classes of the rim of the mesh, and its free edges against the outline of the object."""
