"""The recorder, its files, and the repair of files that were cut short."""
