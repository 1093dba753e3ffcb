"""The joint solve: cameras, poses, boards and depth terms from corners and planes, with covariances."""
