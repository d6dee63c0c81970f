"""State: what the subject is like is written down, made ready, kept by cases and put back."""
