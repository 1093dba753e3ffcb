"""E4 and E5: flat boards under a bias that depends on the amplitude."""
