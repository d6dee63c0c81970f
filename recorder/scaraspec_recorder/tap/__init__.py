"""Forwards bytes between client and controller: TCP proxy, routes and serial relay.

Forward first: nothing here waits for the recording. Does not belong here: the meaning of the bytes.
"""
