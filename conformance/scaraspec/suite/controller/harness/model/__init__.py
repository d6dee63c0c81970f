"""Model: the expected state of the controller after a sequence of requests."""
