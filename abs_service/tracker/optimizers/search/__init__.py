"""Search steps that several optimisers share."""
