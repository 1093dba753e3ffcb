"""Terms: negative log-likelihood of one sensor's image, one file per kind of sensor."""
