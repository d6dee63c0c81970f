"""Two-stage commands: how cases begin, observe, stop and finish commands with a final result."""
