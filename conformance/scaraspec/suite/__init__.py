"""The conformance suite: pytest and hypothesis, for any controller or client of the protocol.

It speaks frames and imports neither our controller nor our client, so that a mistake in one
cannot hide in the other.
"""
