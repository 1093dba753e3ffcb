"""Bending stiffness of a strip that hangs from a gripper, from a recording."""
