"""Clause 2: the controller listens on port 8877, for one client after the other (L79)."""

from contextlib import suppress
from typing import Final

from scaraspec.protocol.hazard import Hazard
from scaraspec.protocol.port import DEFAULT_PORT
from scaraspec.suite.controller.harness.controller_under_test import (
    MOMENT_S,
    SILENCE_S,
    ControllerUnderTest,
)
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.engine.case import case
from scaraspec.suite.engine.expectations import (
    CaseFailed,
    CaseInconclusive,
    CaseSkipped,
    NoReply,
    expect,
    expect_equal,
)
from scaraspec.user_message import UserMessage

_TIMES: Final = 100  # A-2-7
_AGAIN: Final = 20
_AGAIN_S: Final = 0.1
_ASKED: Final = 5


@case("2/1")
def test_listens(subject: ControllerUnderTest) -> None:
    """A connection that the client opens is taken, and served for more than one request."""
    line = subject.open()
    line.ask("get_status")
    line.ask("get_version")


@case("2/2")
def test_port(subject: ControllerUnderTest) -> None:
    """The subject takes connections on port 8877, or on the one that the tester named."""
    port = subject.access.port
    if port is None:
        raise CaseSkipped("the link is no network")
    for _ in range(3):
        line = _connect(subject)
        line.ask("get_status")
        line.close()
    if port != DEFAULT_PORT:
        subject.tolerate(
            "2/2",
            "A-2-1",
            UserMessage("port {port}", port=port),
            UserMessage("it was reached on port {port}", port=port),
        )


@case("2/13")
def test_one_after_the_other(subject: ControllerUnderTest) -> None:
    """A hundred clients connect one after the other, ask something, and close."""
    subject.notices_leaving()
    for _ in range(_TIMES):
        line = _connect(subject)
        line.ask("get_status")
        line.close()


@case("2/13", name="leaving")
def test_ways_of_leaving(subject: ControllerUnderTest) -> None:
    """A hundred clients leave in ways that are not orderly; the next is served all the same."""
    subject.notices_leaving()
    for number in range(_TIMES):
        _leave(_connect(subject), number % 5)
    _connect(subject).ask("get_status")


def _leave(line: OutgoingConnection, way: int) -> None:
    """End a connection in one of five ways."""
    match way:
        case 0:  # as if its cable were cut
            line.reset()
        case 1:  # in the middle of a frame
            line.send_bytes(b"\xaa\x09")
            line.close()
        case 2:  # without listening to the answer
            line.send("get_version")
            line.reset()
        case 3:  # listening on, which a subject need not know
            line.send("get_status")
            with suppress(CaseInconclusive):  # no link but TCP can
                line.half_close()
            line.close()
        case _:  # having done nothing
            line.close()


def _connect(subject: ControllerUnderTest) -> OutgoingConnection:
    """Log in; where one client is served at a time, its end may take a moment to be noticed."""
    for _ in range(_AGAIN):
        try:
            return subject.open()
        except NoReply:
            if subject.dialect["max_clients"] != "one":
                raise
            subject.access.pause(_AGAIN_S)
    return subject.open()


# ---------------------------------------------------------------------- a further client


@case("2/12", hazards=(Hazard.READ_ONLY,))
def test_second_client(subject: ControllerUnderTest) -> None:
    """A client connects while a request of another is half sent and answered; none is disturbed.

    What a robot tells of itself (A-3-16) is not told as often as another client asks.
    """
    if not subject.access.several:
        raise CaseSkipped("this link carries one connection at a time")
    told = subject.observer.told_unasked
    first = subject.open()
    version, time = (first.request(name).encode() for name in ("get_version", "get_time"))
    first.send_bytes(version[:2])
    second = subject.open(login=False)
    subject.pause(MOMENT_S / subject.ics.time_scale)  # half a frame may wait for a second
    if _displaced(subject, first, second):
        return
    first.send_bytes(version[2:])
    said = first.reply("get_version").value
    if not _admitted(subject, first, second):
        return
    first.send_bytes(time[:3])
    second.send("get_status")
    first.send_bytes(time[3:])
    second.send("get_version")
    first.reply("get_time")
    second.reply("get_status")
    expect_equal(second.reply("get_version").value, said, "two clients are told two versions")
    for line in (first, second):
        _nothing_of_the_other(alone=all(seen.frame.opcode in told for seen in line.sync()))
    for _ in range(_ASKED):
        second.ask("get_status")
    _nothing_of_the_other(alone=len(first.sync()) < _ASKED)
    second.close()
    first.ask("get_status")


def _nothing_of_the_other(*, alone: bool) -> None:
    expect(
        alone,
        "a client was sent what another one had asked for",
        expected="each reply on the connection that asked",
        observed="a further frame",
    )


def _displaced(
    subject: ControllerUnderTest, first: OutgoingConnection, second: OutgoingConnection
) -> bool:
    """Whether the newcomer has taken the place of the one before (A-2-2)."""
    second.pump()
    if first.ends(within_s=SILENCE_S / subject.ics.time_scale) is None:
        return False
    subject.log_in(second)
    second.ask("get_status")
    subject.tolerate("2/12", "max_clients", "newest", "a new client displaces the one before")
    return True


def _admitted(
    subject: ControllerUnderTest, first: OutgoingConnection, second: OutgoingConnection
) -> bool:
    """Whether the newcomer is served beside the one before; if not, the latter still is."""
    try:
        if subject.access.needs_login:
            subject.log_in(second)
        second.ask("get_version")
    except CaseFailed:  # it may answer the login with 0, or nothing at all
        if _displaced(subject, first, second):
            return False
        first.ask("get_status")
        subject.tolerate("2/12", "max_clients", "one", "a further client is not served")
        return False
    return not _displaced(subject, first, second)
