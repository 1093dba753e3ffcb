"""An application: a gripper that follows a sheet of paper."""
