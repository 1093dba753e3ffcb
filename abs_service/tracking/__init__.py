"""A tracker over time: session, live process, replay, warm-up, monitors."""
