"""Hostile text made harmless to read: what a terminal, a page or XML would act on is shown instead.

Every string that a writer puts out goes through here once. What each format has as its own
mark-up is escaped by its own library.
"""

import re
from typing import Final

_LONGEST: Final = 10_000
_PLANES: Final = range(0, 0x110000, 0x10000)

# Controls but for tab and LF, what turns the direction of writing, line ends that are no LF, the
# byte order mark, lone surrogates, and the two code points in each plane that are no characters.
_NO_CHARACTERS: Final = "".join(chr(plane + 0xFFFE) + chr(plane + 0xFFFF) for plane in _PLANES)
_UNSEEN: Final = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200b-\u200f\u2028-\u202e\u2060-\u206f\ufeff\ufff9-\ufffb"
    f"\ud800-\udfff\ufdd0-\ufdef\U000e0000-\U000e0fff{_NO_CHARACTERS}]"
)


def visible(text: str) -> str:
    """The text with the code in place of each character that cannot be seen; cut if huge."""
    if len(text) > _LONGEST:
        text = f"{text[:_LONGEST]}… (+{len(text) - _LONGEST})"
    return _UNSEEN.sub(_code, text)


def _code(found: re.Match[str]) -> str:
    return f"⟨U+{ord(found[0]):04X}⟩"
