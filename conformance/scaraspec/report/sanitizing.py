"""Sanitizing of untrusted text: control characters and invisible characters become visible.

Every string that a writer outputs is sanitized once. The markup of each format is escaped by the
library of that format.
"""

import re
from typing import Final

_LONGEST: Final = 10_000
_PLANES: Final = range(0, 0x110000, 0x10000)

# Control characters except tab and LF, direction marks, line ends other than LF, the byte order
# mark, lone surrogates, and the two noncharacters of each plane.
_NO_CHARACTERS: Final = "".join(chr(plane + 0xFFFE) + chr(plane + 0xFFFF) for plane in _PLANES)
_UNSEEN: Final = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200b-\u200f\u2028-\u202e\u2060-\u206f\ufeff\ufff9-\ufffb"
    f"\ud800-\udfff\ufdd0-\ufdef\U000e0000-\U000e0fff{_NO_CHARACTERS}]"
)

_COMMANDS: Final = re.compile(r"\n|(?<=#)#(?=\w*\[)")


def visible(text: str) -> str:
    """Return the text with invisible characters replaced by their code points; cut if too long."""
    if len(text) > _LONGEST:
        text = f"{text[:_LONGEST]}… (+{len(text) - _LONGEST})"
    return _UNSEEN.sub(_code, text)


def visible_line(text: str) -> str:
    """Return visible text in one line, in which no CI system finds a command such as ``##[error]``.

    CI systems read commands in the output of a job: some at the start of a line, some anywhere.
    """
    return _COMMANDS.sub(_code, visible(text))


def _code(found: re.Match[str]) -> str:
    return f"⟨U+{ord(found[0]):04X}⟩"
