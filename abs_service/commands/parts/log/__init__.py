"""The log of every command: its options, its file, and the output of native libraries."""
