"""Reads TOML files of the user, with a size limit and clear error messages."""

import tomllib
from pathlib import Path
from typing import Any, Final

from scaraspec.user_message import UserMessage

_MAX_FILE_BYTES: Final = 1 << 20


class TomlError(ValueError):
    """The file cannot be read. The message is a sentence without its subject, the file name."""


def read_toml(path: Path) -> dict[str, Any]:
    """Read a TOML file of at most 1 MiB.

    Raises:
        TomlError: The file cannot be read, is too large, or is not valid TOML.
    """
    try:
        with path.open("rb") as file:
            data = file.read(_MAX_FILE_BYTES + 1)
    except OSError as error:
        raise TomlError(
            UserMessage("cannot be read: {reason}", reason=error.strerror or error)
        ) from None
    if len(data) > _MAX_FILE_BYTES:
        raise TomlError("is larger than 1 MiB")
    try:
        return tomllib.loads(data.decode())
    except (ValueError, RecursionError) as error:
        raise TomlError(UserMessage("is not a valid TOML file: {error}", error=error)) from None
