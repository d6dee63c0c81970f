"""Requirements that no rule decides although a recording might decide them, with the reason."""

from collections.abc import Mapping
from types import MappingProxyType

_GEOMETRY = (
    "the document states no arm dimensions, zero pose or axes (A-7-1): numbers alone do not show "
    "which point or angle they describe"
)
_NO_SECOND_SOURCE = "the recording has no second source to compare the digits with"

UNDECIDED: Mapping[str, str] = MappingProxyType(
    {
        "4.23/3": _GEOMETRY,
        "4.27/5": _GEOMETRY,
        "4.31/3": _NO_SECOND_SOURCE,
        "5.2/20": "the file at its sender is not in the recording; 5.2/12 compares both ways",
        "7/1": _GEOMETRY,
        "7/4": _GEOMETRY,
        "8/4": "only the robot knows which motors are faulty",
    }
)
"""The reason, by requirement."""
