"""Model: what the controller must be like after a sequence of requests."""
