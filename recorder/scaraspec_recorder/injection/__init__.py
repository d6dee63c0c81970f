"""Faults on purpose: what is done to frames, to which of them, and when; see `inject` for files."""
