"""Call: an operation that a client under test was asked for, and what it said of it.

What it should have said is not known here.
"""

import json
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Mapping


class Call:
    """An operation.

    Attributes:
        number: Its id.
        name: Its name.
        values: What was ordered.
        answer: What the client said of it; None as long as it has said nothing.
        came: The request that it brings about has come, or the first of several.
        begun_ns: When it was ordered.
    """

    def __init__(self, number: int, name: str, values: "Mapping[str, Any]") -> None:
        self.number, self.name, self.values = number, name, values
        self.answer: Mapping[str, Any] | None = None
        self.request_seen = False
        self.begun_ns = 0

    @property
    def unimplemented(self) -> bool:
        """Whether the client lacks the operation."""
        return (self.answer or {}).get("unimplemented") is True

    @property
    def ok(self) -> bool:
        """Whether the client says that it was done."""
        return (self.answer or {}).get("ok") is True

    @property
    def failed(self) -> bool:
        """Whether the client says that it was not; a refusal or a bad outcome says so, too."""
        return self.answer is not None and not (self.ok and not _bad(self.result))

    @property
    def result(self) -> Any:
        """What came of it."""
        return (self.answer or {}).get("result")

    @property
    def error(self) -> str:
        """Why it was not done, in the client's words."""
        return str((self.answer or {}).get("error", ""))

    def __str__(self) -> str:
        return json.dumps(self.answer, ensure_ascii=False) if self.answer else "no answer"


def _bad(result: Any) -> bool:
    """Whether the result of a two-stage command tells a refusal or a failure."""
    return isinstance(result, dict) and (
        result.get("accepted") is False or result.get("outcome") == "00"
    )
