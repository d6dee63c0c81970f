"""The protocol as the document defines it: frames, commands, codes, transfers and program files.

This package uses only the standard library. It does no I/O: no socket, clock, thread, file or
logger. Bytes and times are arguments. An import contract checks this. Verdicts on a peer's
behaviour are in `scaraspec.judge`.
"""
