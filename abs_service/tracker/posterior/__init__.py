"""Cost of theta: objective plus priors, its curvature, and the covariance."""
