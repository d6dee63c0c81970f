"""The contents of the files that the suite sends."""

import hashlib


def content_of(size_bytes: int, seed: int = 0) -> bytes:
    """Return pseudo-random content of this size: no part of it repeats."""
    return hashlib.shake_128(seed.to_bytes(4)).digest(size_bytes)
