"""Contents: what the files that the suite sends are made of."""

import hashlib


def content_of(size_bytes: int, seed: int = 0) -> bytes:
    """A file of this size without a pattern, so that no piece of it can be taken for another."""
    return hashlib.shake_128(seed.to_bytes(4)).digest(size_bytes)
