"""The recorder: a transparent proxy that never waits, and everything that is made of what it saw.

`forwarding` forwards, `spooling` bridges, the `scribe` writes, each for itself. What it writes is
made once in `deriving`, put into files by `mcap` and `drawing`, and kept by `keeping`. `recording`
joins them. Captures of any kind come back as wire events through `source`.
"""
