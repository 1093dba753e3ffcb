"""The command `new`: questions, and the rig file that follows from the answers."""
