"""The disk under the recordings: its room, how long it lasts, what is deleted first."""
