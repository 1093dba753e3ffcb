"""Templates: what is known of the object's shape before it is seen; one module each, named by `type`."""
