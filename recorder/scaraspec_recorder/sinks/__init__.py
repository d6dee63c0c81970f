"""Outputs of a recording: the sink runner, decoding, MCAP, Rerun and pcapng.

Belongs here: everything that turns wire events into output. The decoder runs once for all outputs.
Does not belong here: rotation and retention of files (`recordings`).
"""
