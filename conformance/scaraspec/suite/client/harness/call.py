"""Call: an operation that the suite started on the client, and the answer of the client.

The expected answer is not known here.
"""

import json
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Mapping


class Call:
    """An operation that was started.

    Attributes:
        number: The id in the driver protocol.
        name: The name of the operation.
        values: The values of the operation, by name.
        answer: The answer of the client; None while it is pending.
        request_seen: The request of the operation, or the first of several, was received.
        begun_ns: The start time in nanoseconds since the Unix epoch.
    """

    def __init__(self, number: int, name: str, values: "Mapping[str, Any]") -> None:
        self.number, self.name, self.values = number, name, values
        self.answer: Mapping[str, Any] | None = None
        self.request_seen = False
        self.begun_ns = 0

    @property
    def unimplemented(self) -> bool:
        """Whether the client does not implement the operation."""
        return (self.answer or {}).get("unimplemented") is True

    @property
    def ok(self) -> bool:
        """Whether the client reports success."""
        return (self.answer or {}).get("ok") is True

    @property
    def failed(self) -> bool:
        """Whether the client reports a failure, a refusal or a failed outcome."""
        return self.answer is not None and not (self.ok and not _is_failed_result(self.result))

    @property
    def result(self) -> Any:
        """The result in the answer; None without one."""
        return (self.answer or {}).get("result")

    @property
    def error(self) -> str:
        """The error text in the answer."""
        return str((self.answer or {}).get("error", ""))

    def __str__(self) -> str:
        return json.dumps(self.answer, ensure_ascii=False) if self.answer else "no answer"


def _is_failed_result(result: Any) -> bool:
    """Whether the result of a two-stage command is a refusal or a failed outcome."""
    return isinstance(result, dict) and (
        result.get("accepted") is False or result.get("outcome") == "00"
    )
