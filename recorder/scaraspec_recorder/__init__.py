"""The recorder: a transparent proxy whose link never waits for the recording, and its outputs.

Belongs here: `tap` (forwarding), `spool` (hand-over to the writer process), `sinks` (decoding and
output formats), `recordings` (rotation, retention, index, repair), `sources` (capture readers),
`fault_injection` and `monitoring`. `recording` combines them.

Does not belong here: judging traffic (`scaraspec.judge`), the command line (`scaraspec.cli`).
"""
