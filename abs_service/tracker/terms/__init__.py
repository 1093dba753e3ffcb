"""Terms: negative log-likelihood of one sensor's image: depth, pictures or a light barrier; and their parts."""
