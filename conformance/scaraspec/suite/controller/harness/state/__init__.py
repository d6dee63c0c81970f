"""State: reads, prepares, watches and restores the state of the controller."""
