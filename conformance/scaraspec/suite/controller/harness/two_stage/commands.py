"""Commands: two-stage commands, and how a case starts them."""

import math
from collections.abc import Mapping
from contextlib import suppress
from typing import Any, Final, NamedTuple

from scaraspec.protocol.commands import COMMANDS
from scaraspec.protocol.errors import BUSY
from scaraspec.protocol.payloads import JogDirection
from scaraspec.suite.controller.harness.controller_under_test import (
    ControllerUnderTest,
)
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.files import upload
from scaraspec.suite.controller.harness.requests.motion import (
    SLOWEST_PERCENT,
    move_target,
    pose_of,
    release_latch,
)
from scaraspec.suite.engine.connection import ReceivedFrame
from scaraspec.suite.engine.expectations import (
    CaseFailed,
    CaseInconclusive,
    CaseSkipped,
    NoReply,
    preparation,
)
from scaraspec.suite.program_files.layout import configured, find_layout, layout_in_use
from scaraspec.suite.program_files.writing import wait_program
from scaraspec.user_message import UserMessage

RUN, SIMULATE, STOP, RESET = "run_program", "simulate_program", "emergency_stop", "reset"

MOVE, RELEASE, LOCK, JOG = "set_tool_coordinates", "release_joints", "lock_joints", "jog"

TWO_STAGE: Final = tuple(command.name for command in COMMANDS if command.two_stage)

STATES: Final[Mapping[str, str]] = {RUN: "01", SIMULATE: "02", RESET: "03", MOVE: "04", JOG: "04"}
"""The long-running commands, and the status while they execute (L1018-1021)."""

ACCEPTANCE: Final[Mapping[str, str]] = {
    RUN: "4.15/4",
    SIMULATE: "4.16/2",
    STOP: "4.17/3",
    RESET: "4.18/3",
    MOVE: "4.24/5",
    RELEASE: "4.25/2",
    LOCK: "4.26/2",
    JOG: "4.28/4",
}
"""The requirement for each command that the first reply is "1"."""

LASTS_S: Final = 5
"""The wait of a program that will be interrupted, in seconds of our clock."""

BRIEFLY_S: Final = 0.5
"""The wait of a program whose end a case awaits, in seconds of our clock."""

_REQUESTS: Final = 20
"""How many consecutive requests a program outlasts that will be interrupted."""

_NS: Final = 1e9


def begin(
    subject: ControllerUnderTest, line: OutgoingConnection, name: str, value: Any = None
) -> ReceivedFrame:
    """Begin a two-stage command on an idle robot; a refusal fails the case.

    Returns:
        The first reply.

    Raises:
        CaseFailed: The subject refuses the command.
        CaseSkipped: The subject does not support the command.
    """
    require_command(subject, name)
    subject.moved = True
    return expect_accepted(name, line.ask(name, value))


def begin_or_skip(
    subject: ControllerUnderTest, line: OutgoingConnection, command: str, value: Any = None
) -> None:
    """Begin a two-stage command; a refusal skips the case (see `begin`).

    Raises:
        CaseSkipped: The subject refuses the command.
    """
    subject.moved = True
    answer = line.ask(command, value)
    if not answer.accepted:
        raise CaseSkipped(
            UserMessage("{command} was refused: {reply}", command=command, reply=answer)
        )


def require_command(subject: ControllerUnderTest, *names: str) -> None:
    """Continue only if the subject supports these commands.

    Raises:
        CaseSkipped: The ICS states that a command is not supported.
    """
    for name in names:
        if name in subject.ics.unsupported:
            raise CaseSkipped(UserMessage("the subject does not support {name}", name=name))


def expect_accepted(name: str, answer: ReceivedFrame) -> ReceivedFrame:
    """Fail the case unless the first reply accepts the command; return the reply.

    Raises:
        CaseFailed: The reply is a refusal.
    """
    if answer.accepted:
        return answer
    busy = answer.code in BUSY
    raise CaseFailed(
        UserMessage(
            "the idle robot refuses {name}{reason}",
            name=name,
            reason=" as busy" if busy else "",
        ),
        expected="1",
        observed=f"{answer}",
        requirement="4/15" if busy else ACCEPTANCE[name],
    )


@preparation()
def upload_wait_program(
    subject: ControllerUnderTest,
    line: OutgoingConnection,
    seconds: float | None = None,
    name: bytes = b"",
) -> bytes:
    """Upload a program that waits.

    Args:
        subject: The controller under test.
        line: The connection.
        seconds: The minimum wait, in seconds of our clock; None for longer than all requests of a
            case, however slow the replies are.
        name: The name of the program; empty for a new name.

    Returns:
        The name of the program.
    """
    if seconds is None:
        requested_s = subject.now_ns / _NS
        reply_s = line.ask("get_status").time_s - requested_s
        seconds = max(LASTS_S, int(_REQUESTS * reply_s), math.ceil(subject.reply_s))
    name = name or subject.new_name()
    scaled = math.ceil(seconds * subject.ics.time_scale)
    _upload_wait(subject, line, name, scaled)
    return name


def upload_short_program(
    subject: ControllerUnderTest, line: OutgoingConnection, name: bytes
) -> bytes:
    """Upload a program that ends at once, under this name."""
    _upload_wait(subject, line, name, 0)
    return name


def _upload_wait(
    subject: ControllerUnderTest, line: OutgoingConnection, name: bytes, seconds: int
) -> None:
    layout, base = layout_in_use(subject), configured(subject, line)
    upload(line, name, wait_program(subject.dialect, seconds, layout=layout, base=base))


class Started(NamedTuple):
    """The name of a started program, and the first reply."""

    program: bytes
    answer: ReceivedFrame


def start_program(
    subject: ControllerUnderTest, line: OutgoingConnection, name: str, seconds: float | None = None
) -> Started:
    """Run or simulate a program that waits (see `upload_wait_program`).

    The layout of program files is determined first (A-6.1-2).

    Args:
        subject: The controller under test.
        line: The connection that starts the program.
        name: The command: `run_program` or `simulate_program`.
        seconds: How long the program waits; None for long enough to be interrupted.

    Raises:
        CaseFailed: The subject refuses the command.
    """
    require_command(subject, name)
    subject.moved = True
    if RUN not in subject.ics.unsupported:
        with suppress(CaseFailed, CaseInconclusive):  # the cases about layouts report this
            find_layout(subject, line)
    release_latch(subject, line)
    program = upload_wait_program(subject, line, seconds)
    return Started(program, expect_accepted(name, line.ask(name, program)))


def try_request(
    line: OutgoingConnection, name: str, value: Any = None, *, data: bytes | None = None
) -> ReceivedFrame | None:
    """Send a request that may be refused or not answered (A-4-2, A-3-9).

    A status query shows that no reply comes. All other frames that arrive before its reply stay in
    the inbox. After an accepted two-stage command the robot may answer no query (A-4-3).

    Returns:
        The first reply; None if there is none, or if the connection ends.
    """
    line.send(name, value, data=data)
    try:
        line.inbox[:0] = line.sync()
    except NoReply:
        replies = [s for s in line.inbox if s.name == name and not s.frame.tagged]
        accepted = name in TWO_STAGE and any(ReceivedFrame(s, s.value).accepted for s in replies)
        if line.ending is None and not accepted:
            raise
    with suppress(NoReply):
        return line.reply(name, within_s=0.0)
    return None


def harmless_requests(subject: ControllerUnderTest, line: OutgoingConnection) -> Mapping[str, Any]:
    """Return a request value with little effect for each two-stage command except the stop."""
    program = upload_wait_program(subject, line, 0)
    values: dict[str, Any] = {
        RUN: program,
        SIMULATE: program,
        MOVE: move_target(pose_of(line), SLOWEST_PERCENT),
        JOG: JogDirection.PLUS_X,
    }
    return {
        name: values.get(name)
        for name in TWO_STAGE
        if name != STOP and name not in subject.ics.unsupported
    }
