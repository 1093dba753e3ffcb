"""Acting on a rig from the page: choosing the object, and commands to tracker, recorder and devices."""
