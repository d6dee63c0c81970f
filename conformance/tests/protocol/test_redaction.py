"""Which frames may contain a password, and how passwords are masked."""

import pytest

from scaraspec.protocol.direction import A2C, C2A
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.redaction import is_secret, mask, mask_unframed


@pytest.mark.parametrize(
    ("frame", "secret"),
    [
        (Frame(A2C, 0x01, b"x"), True),
        (Frame(A2C, 0x03, b"old|new"), True),
        (Frame(C2A, 0x01, b"1"), False),
        (Frame(C2A, 0x01, b"open sesame"), True),  # a reply that repeats the password
        (Frame(A2C, 0x09), False),
    ],
)
def test_is_secret(frame: Frame, secret: object) -> None:
    """The requests of 4.1 and 4.2 are secret, and replies that repeat them; a flag is not."""
    assert is_secret(frame) is secret


def test_mask_keeps_length_and_bars() -> None:
    """Masked data keep their length and their bars."""
    assert mask(b"old|newer") == b"***|*****"


@pytest.mark.parametrize(
    ("data", "masked"),
    [
        (b"abc\xaa\x01\x05pass", b"abc\xaa\x01\x05****"),
        (b"\xcc\x03\x0cold|new", b"\xcc\x03\x0c***|***"),
        (b"\xaa\x01", b"\xaa\x01"),
        (b"nothing here", b"nothing here"),
    ],
)
def test_mask_unframed_keeps_the_bytes_before_the_secret(data: bytes, masked: bytes) -> None:
    """Only the bytes after the header of a secret frame are masked."""
    assert mask_unframed(data) == masked
