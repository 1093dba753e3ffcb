"""The truth of the experiments: surfaces, what cameras see of them, and how they err.

Nothing of it is shared with the tracker: splines are SciPy's, images are made of points that are splatted, and the true
law of the errors is a physical one. `abs_service.tracker` must not be imported here, and is not (`make lint`).
"""
