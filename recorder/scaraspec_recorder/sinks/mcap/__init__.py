"""Writes MCAP files: the container, the schemas and the sink.

Does not belong here: reading (`sources.mcap_reader`) and rotation of files (`recordings`).
"""
