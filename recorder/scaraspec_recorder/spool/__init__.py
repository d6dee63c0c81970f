"""Spooling: what passed, on its way from the process that forwards to the one that writes.

Law: records in, wire events out; bounded, and safe from the end of either process. What they mean
is unknown here.
"""
