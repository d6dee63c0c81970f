"""Where the suite plays the controller, for a client under test."""
