"""Templates: shapes that are known before the object is seen; one module each, named by `type`."""
