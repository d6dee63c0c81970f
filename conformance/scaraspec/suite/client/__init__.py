"""Certification of a client: the cases, and the harness in which the suite acts as controller."""
