"""Asking: what a client asks of a robot, subject by subject, and reads out of the answers."""
