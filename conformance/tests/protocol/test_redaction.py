"""Passwords are told from what is none, and hidden so that frames stay frames."""

import pytest

from scaraspec.protocol.direction import A2C, C2A
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.redaction import is_secret, mask, mask_loose


@pytest.mark.parametrize(
    ("frame", "secret"),
    [
        (Frame(A2C, 0x01, b"x"), True),
        (Frame(A2C, 0x03, b"old|new"), True),
        (Frame(C2A, 0x01, b"1"), False),
        (Frame(C2A, 0x01, b"open sesame"), True),  # a faulty echo
        (Frame(A2C, 0x09), False),
    ],
)
def test_what_is_secret(frame: Frame, secret: object) -> None:
    """The requests of 4.1 and 4.2, and a reply that repeats them; no flag."""
    assert is_secret(frame) is secret


def test_masked_data_keep_length_and_bars() -> None:
    """The frame reads as before, with other passwords."""
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
def test_loose_masking_keeps_what_comes_before(data: bytes, masked: bytes) -> None:
    """Only what follows the head of a secret frame is hidden."""
    assert mask_loose(data) == masked
