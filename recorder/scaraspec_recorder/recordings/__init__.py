"""Manages the files of recordings: rotation, retention, index, trigger marks and repair.

Does not belong here: the content of the files (`sinks.mcap`, `sinks.rerun`).
"""
