"""Board images from files, recordings and live devices."""
