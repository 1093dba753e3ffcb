"""A strip that hangs from a gripper in the first depth image, and the elastica that fits it."""
