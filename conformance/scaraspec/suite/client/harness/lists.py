"""Lists: a program list in parts, pushed or fetched as the client has it (A-4.10-3)."""

from collections.abc import Callable
from typing import Final

from scaraspec.suite.client.harness.auto_responder import FETCHES
from scaraspec.suite.client.harness.call import Call
from scaraspec.suite.client.harness.client_under_test import ClientUnderTest
from scaraspec.suite.client.harness.incoming_connection import IncomingConnection
from scaraspec.suite.engine.expectations import NoReply

_FETCH_S: Final = 1.0


def list_of(*names: str | bytes, per_part: int, bar: bytes = b"|") -> list[bytes]:
    """The data of the parts of a list.

    Args:
        names: Its names.
        per_part: How many of them stand in each part.
        bar: What stands between the flag and the first name (A-4.10-2).
    """
    encoded = [name if isinstance(name, bytes) else name.encode() for name in names]
    parts = [encoded[i : i + per_part] for i in range(0, len(encoded), per_part)]
    flags = [b"1"] * (len(parts) - 1) + [b"0"]
    return [flag + bar + b"|".join(part) for flag, part in zip(flags, parts, strict=True)]


def serve_list(
    subject: ClientUnderTest,
    line: IncomingConnection,
    call: Call,
    parts: list[bytes],
    ahead: Callable[[], None] = lambda: None,
) -> None:
    """Answer a request for the program list part by part.

    A client that asks for a further part by itself is given it as the answer to that; any other
    has it pushed.

    Args:
        subject: The client.
        line: Its connection.
        call: Its order.
        parts: The data of the parts.
        ahead: Done ahead of each further part.

    Raises:
        CaseFailed: No request came.
    """
    line.request("list_programs", call)
    line.reply("list_programs", data=parts[0])
    for part in parts[1:]:
        _await_fetching(subject, line)
        ahead()
        line.reply("list_programs", data=part)


def fetches_parts(subject: ClientUnderTest, line: IncomingConnection) -> bool:
    """Whether a client asks for each part of a list by itself; found out once, by a list of two."""
    if FETCHES not in subject.known:
        call = subject.begin("list_programs")
        serve_list(subject, line, call, list_of("a.rob", "b.rob", per_part=1))
        subject.settled(call)
    return bool(subject.known[FETCHES])


def _await_fetching(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """Await that the next part is asked for; whether a client does is found out once."""
    patience_s = {None: _FETCH_S, False: 0.0, True: subject.answer_s}
    known = subject.known.get(FETCHES)
    try:
        line.request("list_programs", within_s=patience_s[known])
    except NoReply:
        subject.known[FETCHES] = False
    else:
        subject.known[FETCHES] = True
        subject.found["list_cont"] = "request"
