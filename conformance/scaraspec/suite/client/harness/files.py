"""Files: how the suite, as the controller, receives an upload and sends a download.

Each check here names its own requirement, whatever requirement the case has. Cases about failing
transfers send their own answers, and their own chunks with `Download.offer_chunk`.
"""

from collections.abc import Callable
from contextlib import suppress
from typing import Final

from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.transfer import Chunk
from scaraspec.suite.client.harness.call import Call
from scaraspec.suite.client.harness.client_under_test import ClientUnderTest
from scaraspec.suite.client.harness.incoming_connection import IncomingConnection
from scaraspec.suite.engine.connection import ReceivedFrame
from scaraspec.suite.engine.deadline import Deadline
from scaraspec.suite.engine.expectations import CaseFailed, NoReply, expect, expect_equal
from scaraspec.suite.engine.transfer_timeouts import transfer_timeouts_of
from scaraspec.traffic.events import FrameSeen
from scaraspec.user_message import UserMessage

_TRANSFER: Final = range(0x50, 0x57)
SLICE_S: Final = 0.05  # between two checks for an answer of the client
MAX_RETRIES: Final = 20
_GRACE_S: Final = 0.5  # until the client reports an aborted transfer


# ---------------------------------------------------------------------- either way


def request_or_none(
    subject: ClientUnderTest,
    line: IncomingConnection,
    call: Call,
    command: str,
    within_s: float | None = None,
) -> ReceivedFrame | None:
    """Wait for a request; None if it does not come, or not soon after the operation ends.

    The network may still carry bytes that the client sent before it reported the end.
    """
    deadline = Deadline(subject, subject.answer_timeout_s if within_s is None else within_s)
    while True:
        answered = call.answer is not None
        if answered:
            deadline = Deadline(subject, min(deadline.remaining_s, subject.silence_s))
        last = line.ended or deadline.expired
        with suppress(NoReply):
            return line.request(command, within_s=min(SLICE_S, deadline.remaining_s))
        if last or (answered and not line.unfinished):
            return None


def wait_for_transfer_end(
    subject: ClientUnderTest, call: Call, within_s: float, requirement: str
) -> None:
    """Wait for the answer to an operation. An operator is asked later.

    Raises:
        CaseFailed: No answer comes.
    """
    if not subject.access.attended:
        try:
            subject.wait_for_answer(call, within_s=within_s)
        except CaseFailed as error:
            error.requirement = requirement
            raise


def expect_transfer_done(subject: ClientUnderTest, call: Call) -> None:
    """Require that a complete transfer ends successfully.

    Raises:
        CaseFailed: It does not.
    """
    wait_for_transfer_end(
        subject, call, subject.answer_timeout_s, "5.1/7"
    )  # the client never ends the transfer
    subject.expect_done(call, requirement="5.2/19")


def expect_transfer_failed(
    subject: ClientUnderTest, call: Call, requirement: str = "5.2/19"
) -> None:
    """Require that a transfer fails, at once or after a timeout (A-5-14).

    Raises:
        CaseFailed: It does not.
    """
    wait_for_transfer_end(
        subject, call, transfer_timeouts_of(subject).must_end_s + _GRACE_S, requirement
    )
    subject.expect_failure(call, requirement=requirement)


def transfer_frames(line: IncomingConnection) -> list[FrameSeen]:
    """Return the received frames of clause 5 that no case has taken."""
    return [seen for seen in line.inbox if seen.frame.opcode in _TRANSFER]


def is_abort_signal(seen: FrameSeen | ReceivedFrame) -> bool:
    """Whether this is the signal that ends an upload and needs no answer (L787; A-5-10)."""
    if seen.frame.opcode != BY_NAME["upload_chunk"].opcode:
        return False
    return not seen.frame.data or (isinstance(seen.value, Chunk) and not seen.value.length)


def expect_no_transfer_frames(
    line: IncomingConnection,
    message: str,
    requirement: str,
    for_s: float = 0.0,
    *,
    allowed: Callable[[FrameSeen], bool] | None = None,
) -> None:
    """Require that the client sends no frame of a transfer, before or during this time.

    Args:
        line: Its connection.
        message: The message of the failure.
        requirement: The requirement that such a frame violates.
        for_s: How long to wait, in seconds.
        allowed: Returns True for a frame that the client may send. Such frames are removed.

    Raises:
        CaseFailed: The client sends such a frame.
    """
    line.wait(for_s)
    came = transfer_frames(line)
    for seen in filter(allowed, came.copy()) if allowed else ():
        came.remove(seen)
        line.inbox.remove(seen)
    expect(
        not came,
        message,
        expected="nothing",
        observed="; ".join(f"{seen.frame}" for seen in came),
        requirement=requirement,
    )


def expect_served(
    subject: ClientUnderTest, line: IncomingConnection, what: str
) -> IncomingConnection:
    """Require that another command works, on this connection or on a new one (A-5-26).

    Returns:
        The connection to continue with.

    Raises:
        CaseFailed: The command works on neither.
    """
    try:
        _ask_status(subject, line)
    except CaseFailed as error:
        line.close()
        try:
            line = subject.open()
            _ask_status(subject, line)
        except CaseFailed:
            error.requirement = "5.4/6"
            raise error from None
        message = UserMessage(
            "after {event}, the client works only on a new connection", event=what
        )
        subject.tolerate("5.4/6", "A-5-26", "closed", message)
    return line


def _ask_status(subject: ClientUnderTest, line: IncomingConnection) -> None:
    call = subject.begin("get_status")
    line.serve(call, "00")
    wait_for_transfer_end(subject, call, subject.answer_timeout_s, "5.4/6")
    subject.expect_result(call, "00")


def expect_named_file(line: IncomingConnection, call: Call, remote: str, requirement: str) -> None:
    """Require that the client sends this remote name in the first request of a transfer.

    Raises:
        CaseFailed: It sends another name, or none.
    """
    request = line.request(f"{call.name}_name", call)
    sent = request.frame.data.removesuffix(b"\0")  # some clients end a text with NUL (A-T-3)
    expect_equal(sent, remote.encode(), "the client sent a wrong name", requirement=requirement)


# ---------------------------------------------------------------------- upload


# ---------------------------------------------------------------------- download
