"""Certification of a controller: the cases, and the harness in which the suite acts as client."""
