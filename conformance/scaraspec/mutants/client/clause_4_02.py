"""Mutants of clause 4.2: setting the password."""

from collections.abc import Callable

from scaraspec.client.core import ClientCore
from scaraspec.mutants.client import row
from scaraspec.mutants.operators.client.messages import request_fields, sent_raw
from scaraspec.protocol.commands import PasswordChange


def _raw_pairs(raw: Callable[[PasswordChange], bytes]) -> type[ClientCore]:
    """A pair of passwords that the document does not allow is sent as `raw` returns it."""
    return sent_raw({"set_password"}, raw, lambda _: PasswordChange(b"o", b"n"))


def _with_bar_in_old(pair: PasswordChange) -> bytes:
    return b"|".join(pair) if b"|" in pair.old and b"|" not in pair.new else b""


def _cut(pair: PasswordChange) -> bytes:
    whole = b"|".join(pair)
    return whole[:255] if len(whole) > 255 else b""


row(
    "new-password-first",
    "4.2/1",
    "The new password is sent before the old one.",
    request_fields("set_password", lambda fields: fields[::-1]),
)
row(
    "new-password-alone",
    "4.2/1",
    "The new password is sent without the old one.",
    request_fields("set_password", lambda fields: fields[1:]),
)
row(
    "repeats-the-new-password",
    "4.2/1",
    "The new password is sent twice.",
    request_fields("set_password", lambda fields: [*fields, fields[-1]]),
    subtle=True,
)
row(
    "looks-for-bars-in-new-ones",
    "4.2/7 T/6",
    "An old password that contains a bar is sent.",
    _raw_pairs(_with_bar_in_old),
    subtle=True,
)
row(
    "cuts-long-pairs",
    "4.2/7 T/10",
    "A pair of passwords that is too long is cut to 255 bytes and sent.",
    _raw_pairs(_cut),
)
