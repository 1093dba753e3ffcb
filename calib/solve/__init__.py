"""Bundle adjustment of cameras, poses, boards and depth terms from corners and planes, with covariances."""
