"""Names of recording files: the start time in UTC and the name of the robot."""

import re
import unicodedata
from datetime import UTC, datetime
from typing import Final

from scaraspec_recorder.units import SECOND_NS

_NAME_BYTES: Final = 96  # with time and suffix, within the limits of file systems
_UNSAFE: Final = re.compile(r"[^\w.]+")
_FILE_NAME: Final = re.compile(r"\d{4}-\d\d-\d\dT\d\d-\d\d-\d\dZ_[^/\\]+\.mcap")

INDEX_NAME: Final = "contents.jsonl"
"""The index of a folder of recordings."""


def utc_time(time_ns: int) -> datetime:
    """Convert nanoseconds since the Unix epoch to UTC, in whole seconds."""
    return datetime.fromtimestamp(time_ns // SECOND_NS, UTC)


def file_stem(time_ns: int, robot: str) -> str:
    """Return a file name without suffix, such as ``2026-11-20T23-59-59Z_line-3``."""
    return f"{utc_time(time_ns):%Y-%m-%dT%H-%M-%SZ}_{safe_name(robot) or 'robot'}"


def is_recording_name(name: str) -> bool:
    """Whether a file name has the format of a recording."""
    return bool(_FILE_NAME.fullmatch(name))


def safe_name(text: str) -> str:
    """Return a text that is safe in file names: letters of any script and digits.

    Other characters become a hyphen. Leading and trailing dots are removed; the length is limited.
    """
    letters = _UNSAFE.sub("-", unicodedata.normalize("NFC", text))
    return letters.encode()[:_NAME_BYTES].decode(errors="ignore").strip("-._")
