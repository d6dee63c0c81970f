"""Spoiling: what no client sends: bytes that are no frames, values out of order, long silences."""
