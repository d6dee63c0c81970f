"""The recorder: a transparent proxy that never waits, and everything that is made of what it saw.

`tap` forwards, `spool` bridges, `scribe` writes, each for itself; captures of any kind come back
as wire events through `source`.
"""
