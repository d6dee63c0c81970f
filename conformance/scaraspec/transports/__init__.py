"""Links: byte streams between client and controller over TCP, serial, RFCOMM or memory.

This package also contains link URLs and the clocks. It does not know frames or commands.
"""
