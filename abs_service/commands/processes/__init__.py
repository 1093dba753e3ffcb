"""The processes of `run`, each as a command of its own."""
