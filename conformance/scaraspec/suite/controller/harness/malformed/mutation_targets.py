"""Carriers: the requests that may be damaged, and how it is seen that a subject gets over it.

Only 0x07, 0x08 and 0x09 carry damage, and no damaged bytes hold a whole frame of anything else: a
receiver that looks for frames inside of them would execute it (register, section 13).
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

TARGETS: Final = ("get_time", "get_version", "get_status")
OPCODES: Final = opcodes_of(*TARGETS)

GET_TIME: Final = Frame(A2C, 0x07).encode()
GET_VERSION: Final = Frame(A2C, 0x08).encode()
GET_STATUS: Final = Frame(A2C, 0x09).encode()

FLOOD: Final = GET_VERSION * (MAX_FRAME_BYTES // len(GET_VERSION))
"""Requests enough to fill the longest frame that a receiver can be waiting for."""

_SOON_S: Final = 0.05  # for how long a reply to the first request is looked for
_START: Final = bytes((A2C.start,))


class Recovery(Enum):
    """Where a subject serves again after bytes that are no frame."""

    AT_ONCE = "the next request was served"
    LATER = "the next requests were lost, later ones were served"
    ANEW = "the connection was closed, a new one was served"


def is_harmless(data: bytes) -> bool:
    """Whether no receiver finds a whole frame of anything but a carrier in it.

    Wherever it begins to read; also one that takes the frames of the other direction (A-3-13) or
    the tag from a client.
    """
    return not any(
        _holds(data, at, direction, head)
        for at in range(len(data))
        for direction in (A2C, C2A)
        if data[at] == direction.start
        for head in (at + 1, at + 2 if data[at + 1 : at + 2] == bytes((TAG,)) else at + 1)
    )


def _holds(data: bytes, at: int, direction: Direction, head: int) -> bool:
    """Whether a whole frame with this opcode byte, and none of a carrier, begins here."""
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
"""Bytes none of which begins a frame of a client."""

whole_targets = st.sampled_from((GET_TIME, GET_VERSION, GET_STATUS))
"""Whole frames."""


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
"""Carriers with a wrong end byte, or a length that is not the number of their data bytes."""


# ---------------------------------------------------------------------- getting over it


def expect_recovery(
    subject: ControllerUnderTest,
    data: bytes,
    *,
    requirement: str,
    opcodes: frozenset[int] = OPCODES,
) -> Recovery:
    """Send bytes that are no frames, and see that the subject serves again and does nothing else.

    Args:
        subject: The subject.
        data: The bytes.
        requirement: What it violates if it does something else.
        opcodes: Under which it may answer.

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
    """Check that a subject serves again after bytes that are no frame.

    However it looks for the next frame (A-3-10) and however long it waits for the rest of one
    (A-3-11), after 260 bytes of requests it must find one, unless it closes.

    Raises:
        NoReply: It does not serve new connections.
        CaseFailed: It keeps the connection open and serves nothing on it.
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
    anew = subject.open()
    anew.ask("get_version")
    anew.close()
    if not closed:
        raise CaseFailed(
            "behind bytes that are no frame nothing was served on the connection any more",
            expected="an answer to a later request, or the end of the connection",
            observed="silence, while a new connection is served",
            requirement="3/31",
        )
    return Recovery.ANEW


def _answers(line: OutgoingConnection, data: bytes, within_s: float) -> bool:
    """Send requests for the version; whether one is answered.

    Raises:
        NoReply: The subject has closed.
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
    """Fail the subject if it has sent anything but replies under these opcodes.

    Raises:
        CaseFailed: It has.
    """
    for seen in line.inbox:
        opcode = seen.frame.opcode
        expect(
            opcode in opcodes and not seen.frame.tagged,
            "a frame came that nobody had asked for",
            expected=f"replies under {', '.join(f'{each:02X}' for each in sorted(opcodes))}",
            observed=f"{seen.frame}",
            requirement=requirement if opcode in BY_OPCODE else "3/10",
        )
    expect(
        not line.invalid_bytes,
        "bytes came that are no frame",
        expected="frames",
        observed=line.invalid_bytes[0].data.hex(" ") if line.invalid_bytes else "",
        requirement="3/32",
    )
