"""What the document says: frames, commands, codes, transfers and program files.

Standard library only, and no socket, clock, thread, file or logger: bytes and times come in as
arguments. A lint rule holds this.
"""
