"""Deriving: what a recording means, made once for every file that is written of it.

Law: events in the order of time in, the same events and what they brought about out. No file.
"""
