"""Mutation targets: the requests that may be damaged, and the check that a subject recovers.

Only 0x07, 0x08 and 0x09 are damaged. Damaged bytes never contain a complete frame of another
command: a receiver that searches for frames in them would execute it (register, section 13).
"""

from enum import Enum
from typing import Final

from hypothesis import strategies as st
from hypothesis.strategies import SearchStrategy

from scaraspec.protocol.commands import BY_OPCODE
from scaraspec.protocol.direction import A2C, C2A, Direction
from scaraspec.protocol.frames import MAX_FRAME_BYTES, TAG, Frame
from scaraspec.suite.controller.harness.controller_under_test import SILENCE_S, ControllerUnderTest
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.queries import opcodes_of
from scaraspec.suite.engine.expectations import CaseFailed, NoReply, expect
from scaraspec.user_message import UserMessage

TARGETS: Final = ("get_time", "get_version", "get_status")
OPCODES: Final = opcodes_of(*TARGETS)

GET_TIME: Final = Frame(A2C, 0x07).encode()
GET_VERSION: Final = Frame(A2C, 0x08).encode()
GET_STATUS: Final = Frame(A2C, 0x09).encode()

FLOOD: Final = GET_VERSION * (MAX_FRAME_BYTES // len(GET_VERSION))
"""Requests that fill the longest frame for which a receiver may be waiting."""

_SOON_S: Final = 0.05  # the timeout for a reply to the first request
_START: Final = bytes((A2C.start,))


class Recovery(Enum):
    """When a subject serves requests again after invalid bytes."""

    AT_ONCE = "the next request was served"
    LATER = "the next requests were lost, later ones were served"
    NEW_CONNECTION = "the connection was closed, a new one was served"


def is_harmless(data: bytes) -> bool:
    """Whether the bytes contain no complete frame except those of the targets.

    This holds wherever a receiver begins to read, and for a receiver that accepts frames of the
    other direction (A-3-13) or the tag from a client.
    """
    return not any(
        _holds(data, at, direction, head)
        for at in range(len(data))
        for direction in (A2C, C2A)
        if data[at] == direction.start
        for head in (at + 1, at + 2 if data[at + 1 : at + 2] == bytes((TAG,)) else at + 1)
    )


def _holds(data: bytes, at: int, direction: Direction, head: int) -> bool:
    """Whether a complete frame of another command than the targets begins here."""
    if head + 1 >= len(data) or data[head] in OPCODES:
        return False
    end = head + 2 + data[head + 1]
    return end < len(data) and data[end] == direction.end and at < end


# ---------------------------------------------------------------------- damage


def _can_be_sent(data: bytes) -> bool:
    return is_harmless(data + FLOOD)


stray_bytes: SearchStrategy[bytes] = (
    st.binary(min_size=1, max_size=40)
    .map(lambda data: data.replace(_START, b"\x55"))
    .filter(_can_be_sent)
)
"""Bytes without the start byte of a client's frame."""

whole_targets = st.sampled_from((GET_TIME, GET_VERSION, GET_STATUS))
"""Complete frames of the targets."""


@st.composite
def _spoiled(draw: st.DrawFn) -> bytes:
    opcode = draw(st.sampled_from(sorted(OPCODES)))
    data = draw(st.binary(max_size=12)).replace(_START, b"\x55")
    declared = draw(st.integers(0, 255))
    end = draw(st.integers(0, 255))
    if declared == len(data) and end == A2C.end:
        end = A2C.start
    return bytes((A2C.start, opcode, declared)) + data + bytes((end,))


damaged_targets: SearchStrategy[bytes] = _spoiled().filter(_can_be_sent)
"""Targets with a wrong end byte or a wrong length."""


# ---------------------------------------------------------------------- recovery


def expect_recovery(
    subject: ControllerUnderTest,
    data: bytes,
    *,
    requirement: str,
    opcodes: frozenset[int] = OPCODES,
) -> Recovery:
    """Send invalid bytes, and require that the subject serves again and sends nothing else.

    Args:
        subject: The controller under test.
        data: The bytes.
        requirement: The requirement that another reaction violates.
        opcodes: The opcodes of permitted replies.

    Raises:
        CaseFailed: It no longer serves, or sends an unsolicited reply.
    """
    assert is_harmless(data + FLOOD), "damaged bytes may be executed"
    line = subject.open(judged=False)
    line.send_bytes(data)
    how = recovery_of(subject, line)
    expect_only_replies(line, requirement=requirement, opcodes=opcodes)
    line.close()
    return how


def recovery_of(subject: ControllerUnderTest, line: OutgoingConnection) -> Recovery:
    """Require that a subject serves requests again after invalid bytes.

    After 260 bytes of requests it must find a frame or close the connection, whatever method it
    uses to find the next frame (A-3-10) and to wait for the rest of a frame (A-3-11).

    Raises:
        NoReply: The subject does not serve new connections.
        CaseFailed: The subject keeps the connection open and serves nothing on it.
    """
    try:
        if _answers(line, GET_VERSION, _SOON_S):
            return Recovery.AT_ONCE
        for within_s in (SILENCE_S, subject.reply_s, subject.reply_s):
            if _answers(line, FLOOD, within_s) or _answers(line, GET_VERSION, within_s):
                return Recovery.LATER
    except NoReply:
        pass  # it has closed
    closed = line.ending is not None
    line.close()
    other = subject.open()
    other.ask("get_version")
    other.close()
    if not closed:
        raise CaseFailed(
            "after invalid bytes, no request was served on the connection any more",
            expected="a reply to a later request, or the end of the connection",
            observed="silence, while a new connection is served",
            requirement="3/31",
        )
    return Recovery.NEW_CONNECTION


def _answers(line: OutgoingConnection, data: bytes, within_s: float) -> bool:
    """Send requests for the version. Return whether one is answered.

    Raises:
        NoReply: The subject has closed the connection.
    """
    line.send_bytes(data)
    try:
        line.reply("get_version", within_s=within_s)
    except NoReply:
        if line.ending is not None:
            raise
        return False
    return True


def expect_only_replies(
    line: OutgoingConnection, *, requirement: str, opcodes: frozenset[int] = OPCODES
) -> None:
    """Require that the subject has sent only replies with these opcodes.

    Raises:
        CaseFailed: It has sent something else.
    """
    for seen in line.inbox:
        opcode = seen.frame.opcode
        expect(
            opcode in opcodes and not seen.frame.tagged,
            "a frame came that no request asked for",
            expected=UserMessage(
                "replies with opcodes {opcodes}",
                opcodes=", ".join(f"{each:02X}" for each in sorted(opcodes)),
            ),
            observed=f"{seen.frame}",
            requirement=requirement if opcode in BY_OPCODE else "3/10",
        )
    expect(
        not line.invalid_bytes,
        "bytes came that are not a frame",
        expected="frames",
        observed=line.invalid_bytes[0].data.hex(" ") if line.invalid_bytes else "",
        requirement="3/32",
    )
