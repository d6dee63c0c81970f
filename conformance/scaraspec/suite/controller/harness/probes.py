"""Probes: detect which readings a controller follows, before the cases depend on them.

A probe sends only what the allowed hazards permit. A probe without a result keeps the claim or the
default. The judge reports what is observed later.
"""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import Final

from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.direction import A2C
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.hazard import Hazard
from scaraspec.protocol.payloads import NoData
from scaraspec.protocol.transfer import Chunk
from scaraspec.suite.controller.harness.controller_under_test import (
    SILENCE_S,
    ControllerUnderTest,
)
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.files import upload
from scaraspec.suite.engine.expectations import CaseFailed, CaseInconclusive, NoReply
from scaraspec.suite.engine.transfer_timeouts import transfer_timeouts_of
from scaraspec.suite.engine.unsupported_claims import answers
from scaraspec.suite.program_files.layout import candidates
from scaraspec.suite.program_files.listed import program_names
from scaraspec.suite.program_files.writing import wait_program

_FURTHER: Final = 6
"""How many more clients the cases connect at the same time."""
_LISTED: Final = "4.10/11"
_INITIAL: Final = ("get_initial_tool_position", "set_initial_tool_position")
_TOO_MANY_FIELDS: Final = b"|".join([b"0"] * 12)
_READ_ONLY, _STATE = Hazard.READ_ONLY, Hazard.STATE


@dataclass(frozen=True, slots=True)
class Probe:
    """A test that detects which reading of one open point the controller follows."""

    key: str
    hazard: Hazard
    look: Callable[[ControllerUnderTest], str | None]


def probe_all(subject: ControllerUnderTest) -> None:
    """Run every permitted probe, and use the detected readings from then on."""
    for probe in PROBES:
        if probe.hazard is not _READ_ONLY and probe.hazard not in subject.allowed:
            continue
        try:
            if (option := probe.look(subject)) is not None:
                subject.set_reading(probe.key, option)
            subject.settle()
        except (CaseFailed, CaseInconclusive):
            subject.close_lines()


def probe_unsupported(subject: ControllerUnderTest) -> None:
    """Test the commands that the ICS calls unsupported, as far as the hazards permit it.

    A request with a wrong number of fields changes nothing on a controller that serves the command.
    A query that is read-only is sent correctly, too.
    """
    for name in sorted(subject.ics.unsupported):
        command = BY_NAME[name]
        if command.hazard is not _READ_ONLY and command.hazard not in subject.allowed:
            continue
        requests = [Frame(A2C, command.opcode, _TOO_MANY_FIELDS)]
        if command.hazard is _READ_ONLY and isinstance(command.request, NoData):
            requests.append(Frame(A2C, command.opcode))
        with suppress(CaseFailed, CaseInconclusive):
            subject.served[name] = any(_is_answered(subject, request) for request in requests)
            subject.settle()


def _is_answered(subject: ControllerUnderTest, request: Frame) -> bool:
    """Whether a request has a reply other than that to an undefined opcode (A-3-9)."""
    line = subject.open()
    line.send_frame(request)
    replies = [s.frame for s in line.collect_replies() if s.frame.opcode == request.opcode]
    line.close()
    return any(answers(frame, subject.dialect) for frame in replies)


def _op_get_default(subject: ControllerUnderTest) -> str | None:
    """Query with both opcodes (A-4.12-1), of which one may be undefined (A-3-9)."""
    command = BY_NAME["get_default_program"]
    replies = {}
    for opcode in (command.opcode, command.alternate_opcode):
        assert opcode is not None, "the document prints two"
        line = subject.open()
        line.send_frame(Frame(A2C, opcode))
        with suppress(NoReply):
            for seen in line.collect_replies():
                if seen.frame.opcode == opcode:
                    replies[f"0x{opcode:02X}"] = seen.frame.data
        line.close()
    zeros = [option for option, data in replies.items() if data == b"0"]
    served = [option for option in replies if option not in zeros]
    if not served:  # no default program, or an unknown opcode (A-3-9)
        if len(zeros) > 1 or subject.dialect["on_unknown"] == "0":
            return None
        served = zeros
    return "both" if len(served) > 1 else next(iter(served), None)


def _max_clients(subject: ControllerUnderTest) -> str | None:
    """Connect twice (A-2-2). A displaced client may be disconnected only after a moment.

    A further connection may displace the first of several clients that are served.
    """
    if not subject.access.multiple_connections:
        return None
    first = subject.open()
    try:
        second = subject.open()
        second.ask("get_status")
    except CaseFailed:
        return "one"
    if first.ends(within_s=SILENCE_S) is not None:
        return "newest"
    first.ask("get_status")
    forget = subject.checkpoint()
    try:
        subject.traits.only_first_client_commands = _refuses_second_client(first, second)
    except (CaseFailed, CaseInconclusive):  # a missing reply is the matter of a case
        forget()
    with suppress(CaseFailed):  # it may serve fewer clients
        for _ in range(_FURTHER):
            subject.open(login=False)
        subject.traits.displaces_first_client = first.ends(within_s=SILENCE_S) is not None
    return "many"


def _refuses_second_client(first: OutgoingConnection, second: OutgoingConnection) -> bool:
    """Whether the second client is refused what the first one may do (A-2-2)."""
    subject = first.subject
    if _STATE not in subject.allowed or not subject.ics.unsupported.isdisjoint(_INITIAL):
        return False
    get, change = _INITIAL
    present = first.ask(get).value
    return not second.ask(change, present).accepted and bool(first.ask(change, present).accepted)


def _prelogin(subject: ControllerUnderTest) -> str | None:
    """Query before the login (A-4-4)."""
    if not subject.access.needs_login:
        return None
    line = subject.open(login=False)
    line.send("get_digital_inputs")
    line.wait(SILENCE_S)
    if line.ending is not None:
        return "close"
    if not line.inbox:
        return "ignore"
    reply = line.inbox[0].frame.data
    claimed = subject.dialect["prelogin"]
    served = claimed if claimed in ("reads", "all") else "reads"
    return "failure" if reply == b"0" else served


def _prog_ext(subject: ControllerUnderTest) -> str | None:
    """Request uploads with both extensions (A-0-9)."""
    taken = []
    for extension in (".rob", ".txt"):
        subject.dialect = subject.dialect.replace(prog_ext=extension)
        if _interrupt_upload(subject):
            _probe_interrupted_upload(subject)
            taken.append(extension)
    subject.dialect = subject.dialect.replace(prog_ext=subject.ics.dialect["prog_ext"])
    return "any" if len(taken) > 1 else next(iter(taken), None)


def _interrupt_upload(subject: ControllerUnderTest) -> bool:
    """Begin an upload and close its connection. Return whether the upload was accepted."""
    line = subject.open()
    granted = line.ask("upload_name", subject.new_name()).accepted is True
    line.close()
    return granted


def _probe_interrupted_upload(subject: ControllerUnderTest) -> None:
    """Begin another upload: an interrupted one may last until its timeout (A-5-17)."""
    traits = subject.traits
    if traits.transfers_outlive_connection is not None:
        return
    traits.transfers_outlive_connection = False
    if not _interrupt_upload(subject):
        subject.pause(transfer_timeouts_of(subject).must_end_s)
        traits.transfers_outlive_connection = True
        traits.transfers_outlive_connection = _interrupt_upload(subject)


def _endian(subject: ControllerUnderTest) -> str | None:
    """Send a file of one byte in both byte orders (A-5-2): the wrong one is out of bounds.

    The claimed order comes first, because a receiver may accept both.
    """
    claimed = subject.ics.dialect["endian"]
    for order in sorted(("little", "big"), key=lambda order: order != claimed):
        subject.dialect = subject.dialect.replace(endian=order)
        line = subject.open()
        if not line.ask("upload_name", subject.new_name()).accepted:
            return None
        if line.ask("upload_chunk", Chunk(1, 0, 1, b"!")).accepted:
            return order
        line.close()
    subject.dialect = subject.dialect.replace(endian=claimed)
    return None


def _prog_layout(subject: ControllerUnderTest) -> str | None:
    """Upload a program in one layout after another until one is listed (A-6.1-2)."""
    with subject.observer.ignoring(_LISTED):
        for layout in candidates(subject):
            line, name = subject.open(), subject.new_name()
            upload(line, name, wait_program(subject.dialect, 1, layout=layout))
            if name in program_names(subject, line):
                subject.traits.listed_layout = layout
                return layout.reading
            subject.settle()
    return None


PROBES: Final = (
    Probe("op_get_default", _READ_ONLY, _op_get_default),
    Probe("max_clients", _READ_ONLY, _max_clients),
    Probe("prelogin", _READ_ONLY, _prelogin),
    Probe("prog_ext", _STATE, _prog_ext),
    Probe("endian", _STATE, _endian),
    Probe("prog_layout", _STATE, _prog_layout),
)
"""The probes that run before the cases."""
