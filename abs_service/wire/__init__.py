"""Messages of the service: headers and estimates."""
