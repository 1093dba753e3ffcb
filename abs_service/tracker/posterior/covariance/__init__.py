"""Covariance of every frame's estimate: of Θ (`theta_covariance`) and of the vertices (`vertex_covariance`)."""
