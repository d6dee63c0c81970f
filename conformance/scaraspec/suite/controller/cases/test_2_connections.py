"""Clause 2: the controller listens on port 8877 and serves one client after another (L79)."""

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

_CLIENTS: Final = 100  # A-2-7
_RETRIES: Final = 20
_RETRY_S: Final = 0.1
_REQUESTS: Final = 5


@case("2/1")
def test_listens(subject: ControllerUnderTest) -> None:
    """The controller accepts a connection and serves more than one request on it."""
    line = subject.open()
    line.ask("get_status")
    line.ask("get_version")


@case("2/2")
def test_port(subject: ControllerUnderTest) -> None:
    """The controller accepts connections on port 8877, or on the port that the tester named."""
    port = subject.access.port
    if port is None:
        raise CaseSkipped("the link is not a network link")
    for _ in range(3):
        line = _connect(subject)
        line.ask("get_status")
        line.close()
    if port != DEFAULT_PORT:
        subject.tolerate(
            "2/2",
            "A-2-1",
            UserMessage("port {port}", port=port),
            UserMessage("the controller was reached on port {port}", port=port),
        )


@case("2/13")
def test_one_after_the_other(subject: ControllerUnderTest) -> None:
    """A hundred clients connect one after another, send a request, and close."""
    subject.require_close_detection()
    for _ in range(_CLIENTS):
        line = _connect(subject)
        line.ask("get_status")
        line.close()


@case("2/13", name="leaving")
def test_ways_of_disconnecting(subject: ControllerUnderTest) -> None:
    """A hundred clients disconnect in abnormal ways; the next client is still served."""
    subject.require_close_detection()
    for number in range(_CLIENTS):
        _disconnect(_connect(subject), number % 5)
    _connect(subject).ask("get_status")


def _disconnect(line: OutgoingConnection, way: int) -> None:
    """End a connection in one of five ways."""
    match way:
        case 0:  # as if the cable were cut
            line.reset()
        case 1:  # in the middle of a frame
            line.send_bytes(b"\xaa\x09")
            line.close()
        case 2:  # without waiting for the reply
            line.send("get_version")
            line.reset()
        case 3:  # half-close, which a controller need not support
            line.send("get_status")
            with suppress(CaseInconclusive):  # only TCP supports it
                line.half_close()
            line.close()
        case _:  # without any request
            line.close()


def _connect(subject: ControllerUnderTest) -> OutgoingConnection:
    """Open a connection and log in.

    A controller that serves one client at a time may need some time to detect that the previous
    client disconnected. Therefore the connection is retried.
    """
    for _ in range(_RETRIES):
        try:
            return subject.open()
        except NoReply:
            if subject.dialect["max_clients"] != "one":
                raise
            subject.access.pause(_RETRY_S)
    return subject.open()


# ---------------------------------------------------------------------- a second client


@case("2/12", hazards=(Hazard.READ_ONLY,))
def test_second_client(subject: ControllerUnderTest) -> None:
    """A second client connects while a request of the first is incomplete; both are served.

    A robot may send unsolicited frames (A-3-16). They arrive less often than the second client
    sends requests, and so are not counted as replies to that client.
    """
    if not subject.access.multiple_connections:
        raise CaseSkipped("this link carries only one connection at a time")
    unsolicited = subject.observer.unsolicited_opcodes
    first = subject.open()
    version, time = (first.request(name).encode() for name in ("get_version", "get_time"))
    first.send_bytes(version[:2])
    second = subject.open(login=False)
    subject.pause(MOMENT_S / subject.ics.time_scale)  # a partial frame may be pending for a second
    if _is_replaced(subject, first, second):
        return
    first.send_bytes(version[2:])
    reported_version = first.reply("get_version").value
    if not _are_both_served(subject, first, second):
        return
    first.send_bytes(time[:3])
    second.send("get_status")
    first.send_bytes(time[3:])
    second.send("get_version")
    first.reply("get_time")
    second.reply("get_status")
    message = "two clients received two different versions"
    expect_equal(second.reply("get_version").value, reported_version, message)
    for line in (first, second):
        _expect_no_foreign_reply(
            separate=all(received.frame.opcode in unsolicited for received in line.sync())
        )
    for _ in range(_REQUESTS):
        second.ask("get_status")
    _expect_no_foreign_reply(separate=len(first.sync()) < _REQUESTS)
    second.close()
    first.ask("get_status")


def _expect_no_foreign_reply(*, separate: bool) -> None:
    expect(
        separate,
        "a client received a reply to another client's request",
        expected="each reply on the connection of its request",
        observed="an additional frame",
    )


def _is_replaced(
    subject: ControllerUnderTest, first: OutgoingConnection, second: OutgoingConnection
) -> bool:
    """Whether the new connection replaced the previous one (A-2-2)."""
    second.pump()
    if first.ends(within_s=SILENCE_S / subject.ics.time_scale) is None:
        return False
    subject.log_in(second)
    second.ask("get_status")
    message = "a new client replaces the previous one"
    subject.tolerate("2/12", "max_clients", "newest", message)
    return True


def _are_both_served(
    subject: ControllerUnderTest, first: OutgoingConnection, second: OutgoingConnection
) -> bool:
    """Whether both clients are served; if not, the first one must still be served."""
    try:
        if subject.access.needs_login:
            subject.log_in(second)
        second.ask("get_version")
    except CaseFailed:  # the login may be answered 0, or not at all
        if _is_replaced(subject, first, second):
            return False
        first.ask("get_status")
        subject.tolerate("2/12", "max_clients", "one", "a second client is not served")
        return False
    return not _is_replaced(subject, first, second)
