"""Names of recording files: the start time in UTC and the name of the robot."""

import re
import unicodedata
from datetime import UTC, datetime
from typing import Final

from scaraspec_recorder.units import SECOND_NS

_NAME_BYTES: Final = 96  # with the time and a suffix, within what file systems allow
_UNSAFE: Final = re.compile(r"[^\w.]+")
_FILE_NAME: Final = re.compile(r"\d{4}-\d\d-\d\dT\d\d-\d\d-\d\dZ_[^/\\]+\.mcap")


def utc_time(time_ns: int) -> datetime:
    """A time since the Unix epoch, to the second, in UTC."""
    return datetime.fromtimestamp(time_ns // SECOND_NS, UTC)


def file_stem(time_ns: int, robot: str) -> str:
    """Return the name of a file without its suffix, such as ``2026-11-20T23-59-59Z_line-3``."""
    return f"{utc_time(time_ns):%Y-%m-%dT%H-%M-%SZ}_{safe_name(robot) or 'robot'}"


def is_recording_name(name: str) -> bool:
    """Whether a file is called as recordings are."""
    return bool(_FILE_NAME.fullmatch(name))


def safe_name(text: str) -> str:
    """What of a text may stand in the name of a file anywhere: letters of any script, and digits.

    Everything else becomes a hyphen; it never begins or ends with a dot, and is cut to a length.
    """
    letters = _UNSAFE.sub("-", unicodedata.normalize("NFC", text))
    return letters.encode()[:_NAME_BYTES].decode(errors="ignore").strip("-._")
