"""The Xbox 360 Kinect and the Kinect for Windows, first generation, over USB without an SDK."""
