"""Visualizes a recording with Rerun, in a .rrd file or in a viewer.

An optional extra. capture.mcap is the reference; a failure here does not affect it.
"""
