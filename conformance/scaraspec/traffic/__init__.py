"""Traffic: what happened on the wire: frames, exchanges, transfers, program runs, robot state.

`scaraspec.judge` decides whether it conforms. This package does no I/O.
"""
