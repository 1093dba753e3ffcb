"""The disk of the recordings: free space, forecast, retention."""
