"""Statistics that several experiments share: differences of two methods, and the regions of covariances."""
