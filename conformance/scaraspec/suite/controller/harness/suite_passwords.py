"""Suite passwords: the passwords that cases set temporarily. They are not secret."""

from typing import Final

PLAIN_PASSWORD: Final = b"zspasswords"
"""A word, like the passwords in the document (L128)."""

LONG_PASSWORD: Final = b"zs-%s" % (b"password" * 8)
"""Longer than a buffer of 64 bytes."""

_RARE: Final = (b"zs-Password", LONG_PASSWORD, b"zs")
"""Passwords that a password rule may forbid (A-4.1-3): mixed case, long, short."""

FRAGILE: Final = (b"zs.+%s$", b"zs ", b"007")
"""Passwords that a shell, a pattern or a configuration file may alter, so that the login fails.

They are used only if the hook factory_reset can restore the password.
"""

REFUSABLE: Final = (*_RARE, *FRAGILE)
"""Passwords that a controller may refuse."""


def settable_passwords(*, factory_reset: bool) -> tuple[bytes, ...]:
    """Return the passwords that cases may set, the plain one first.

    Args:
        factory_reset: Whether the password can be restored without a login.
    """
    return (PLAIN_PASSWORD, *_RARE, *(FRAGILE if factory_reset else ()))
