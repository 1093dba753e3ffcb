"""The estimate of one frame, and what its status is judged by."""
