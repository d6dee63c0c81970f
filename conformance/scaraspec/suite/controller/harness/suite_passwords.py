"""Suite passwords: those that cases set for a while. They are no secrets, and reports name them."""

from typing import Final

PLAIN_PASSWORD: Final = b"zspasswords"
"""A word, as the passwords of the document are (L128)."""

LONG_PASSWORD: Final = b"zs-%s" % (b"password" * 8)
"""Longer than a buffer of 64 bytes."""

_RARE: Final = (b"zs-Password", LONG_PASSWORD, b"zs")
"""Passwords that a controller may have rules against (A-4.1-3): of both cases, long, short."""

FRAGILE: Final = (b"zs.+%s$", b"zs ", b"007")
"""Passwords that a shell, a pattern or a configuration file may alter: one could not log in again.

They are used only if the hook factory_reset can set the password back.
"""

REFUSABLE: Final = (*_RARE, *FRAGILE)
"""Passwords that a controller may refuse."""


def settable_passwords(*, factory_reset: bool) -> tuple[bytes, ...]:
    """The passwords that cases may set, the plain one first.

    Args:
        factory_reset: Whether the password can be set back without a login.
    """
    return (PLAIN_PASSWORD, *_RARE, *(FRAGILE if factory_reset else ()))
