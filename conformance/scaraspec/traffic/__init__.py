"""Traffic: what happened on the wire: frames, exchanges, transfers, program runs, robot state.

Whether it conforms is decided in `scaraspec.judge`. Nothing here does any I/O.
"""
