"""Health of a rig as a whole, from the messages of its components: for displays, Prometheus and systemd."""
