"""Program lists in parts, pushed or requested by the client (A-4.10-3)."""

from collections.abc import Callable
from typing import Final

from scaraspec.suite.client.harness.call import Call
from scaraspec.suite.client.harness.client_under_test import ClientUnderTest
from scaraspec.suite.client.harness.incoming_connection import IncomingConnection
from scaraspec.suite.engine.expectations import NoReply

_FETCH_S: Final = 1.0


def list_parts(*names: str | bytes, per_part: int, separator: bytes = b"|") -> list[bytes]:
    """Return the data of the parts of a list.

    Args:
        names: The names.
        per_part: The number of names in each part.
        separator: The bytes between the flag and the first name (A-4.10-2).
    """
    encoded = [name if isinstance(name, bytes) else name.encode() for name in names]
    parts = [encoded[i : i + per_part] for i in range(0, len(encoded), per_part)]
    flags = [b"1"] * (len(parts) - 1) + [b"0"]
    return [flag + separator + b"|".join(part) for flag, part in zip(flags, parts, strict=True)]


def serve_list(
    subject: ClientUnderTest,
    line: IncomingConnection,
    call: Call,
    parts: list[bytes],
    before_part: Callable[[], None] = lambda: None,
) -> None:
    """Answer a request for the program list part by part.

    A client that requests each further part gets it as the reply. For other clients it is pushed.

    Args:
        subject: The client.
        line: Its connection.
        call: The operation.
        parts: The data of the parts.
        before_part: Called before each further part.

    Raises:
        CaseFailed: No request came.
    """
    line.request("list_programs", call)
    line.reply("list_programs", data=parts[0])
    for part in parts[1:]:
        _await_fetching(subject, line)
        before_part()
        line.reply("list_programs", data=part)


def fetches_parts(subject: ClientUnderTest, line: IncomingConnection) -> bool:
    """Whether the client requests each part of a list; found out once, with a list of two."""
    if subject.traits.requests_list_parts is None:
        call = subject.begin("list_programs")
        serve_list(subject, line, call, list_parts("a.rob", "b.rob", per_part=1))
        subject.wait_for_answer(call)
    return bool(subject.traits.requests_list_parts)


def _await_fetching(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """Wait for the request of the next part. Whether the client sends one is found out once."""
    reply_s = subject.dialect.seconds("reply_timeout") or _FETCH_S
    fetch_s = min(_FETCH_S, reply_s / 2)  # a client may request a part that was not pushed in time
    timeout_s = {None: fetch_s, False: 0.0, True: subject.answer_timeout_s}
    try:
        line.request("list_programs", within_s=timeout_s[subject.traits.requests_list_parts])
    except NoReply:
        subject.traits.requests_list_parts = False
    else:
        subject.traits.requests_list_parts = True
        subject.detected_readings["list_cont"] = "request"
