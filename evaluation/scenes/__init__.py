"""Ground truth of the experiments: surfaces, a renderer, and sensors with errors.

Independent of the tracker and of the simulated device: splines are SciPy's, images are rendered by splatting points,
and the law of the errors is physical. An import contract forbids the tracker here (`make lint`).
"""
