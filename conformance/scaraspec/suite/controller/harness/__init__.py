"""Where the suite plays the client, against a controller under test."""
