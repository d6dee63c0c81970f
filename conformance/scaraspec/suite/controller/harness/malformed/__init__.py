"""Malformed traffic: invalid bytes, invalid values, unusual segments and long silences."""
