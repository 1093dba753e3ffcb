"""Publishes what a rig publishes for ROS 2 nodes that use rmw_zenoh, without ROS: `python -m abs_client.ros2`."""
