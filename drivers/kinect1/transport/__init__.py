"""USB transfers of the Kinect v1."""
