"""A TOML file that a user wrote: read whole and within bounds, or one sentence says why not."""

import tomllib
from pathlib import Path
from typing import Any, Final

from scaraspec.user_message import UserMessage

_MAX_FILE_BYTES: Final = 1 << 20


class TomlError(ValueError):
    """A file that cannot be read; the message goes on from its name or from *it*."""


def read_toml(path: Path) -> dict[str, Any]:
    """Read a file of at most 1 MiB.

    Raises:
        TomlError: It cannot be read, is larger, or is no TOML.
    """
    try:
        with path.open("rb") as file:
            data = file.read(_MAX_FILE_BYTES + 1)
    except OSError as error:
        raise TomlError(
            UserMessage("cannot be read: {value}", value=error.strerror or error)
        ) from None
    if len(data) > _MAX_FILE_BYTES:
        raise TomlError("is larger than 1 MiB")
    try:
        return tomllib.loads(data.decode())
    except (ValueError, RecursionError) as error:
        raise TomlError(UserMessage("is no TOML file: {error}", error=error)) from None
