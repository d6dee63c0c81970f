"""Conforming controllers that accept and close connections according to readings of their own."""

import math
from collections.abc import Callable
from typing import Any

import pytest

from scaraspec.judge.verdicts import Verdict
from scaraspec.protocol.commands import BY_OPCODE
from scaraspec.protocol.direction import A2C, C2A
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.hazard import Hazard
from scaraspec.protocol.readings import DEFAULT
from scaraspec.virtual_controller.behaviour import SILENCE
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Action, Carrier, Close, Request, Session

RunCases = Callable[..., Any]


class ClosesAtNextRequest(ControllerCore):
    """After a new network is set, the connection is closed at the next request."""

    closing_opcodes = frozenset(range(0x100))

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._to_close: set[int] = set()

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        if session.connection in self._to_close and frame.opcode in self.closing_opcodes:
            self._end(session, now_s)
            return
        super().handle(session, frame, now_s)
        if frame.opcode == 0x05:
            self._to_close.add(session.connection)


class ClosesAtNextNetwork(ClosesAtNextRequest):
    """After a new network is set, the connection is closed when the next network is set."""

    closing_opcodes = frozenset({0x05})


class ClosesAfterReply(ControllerCore):
    """The connection is closed after the reply to a new network."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        super().handle(session, frame, now_s)
        if frame.opcode == 0x05 and self._value(self._command(frame), frame) is not None:  # type: ignore[arg-type] # it has a row
            self._end(session, now_s)


class ClosesOnMalformed(ControllerCore):
    """A request with an invalid payload closes its connection, except for two-stage commands."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        command = self._command(frame)
        checked = command and command.request.fields and not command.two_stage
        if command and checked and command.initiator is A2C and self._value(command, frame) is None:
            self._end(session, now_s)
        else:
            super().handle(session, frame, now_s)


class ClosesOnAnyMalformed(ControllerCore):
    """A request with an invalid payload closes its connection."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        command = self._command(frame)
        invalid = command and frame.data and self._value(command, frame) is None
        if command and invalid and command.initiator is A2C:
            self._end(session, now_s)
        else:
            super().handle(session, frame, now_s)


class RefusesFurtherLogins(ControllerCore):
    """While one client is logged in, every login of another one is refused (A-2-2)."""

    def login(self, request: Request) -> bool:
        others = [session for session in self.sessions.values() if session is not request.session]
        return not any(session.logged_in for session in others) and super().login(request)


class AnswersZeroBeforeLogin(ControllerCore):
    """Every request before the login is answered 0 (A-4-4)."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        if session.logged_in or frame.opcode == 0x01:
            super().handle(session, frame, now_s)
        else:
            self.emit(session, Frame(C2A, frame.opcode, b"0"))


class LocksOut(ControllerCore):
    """After two consecutive wrong passwords, every login is refused (A-4.1-2)."""

    _wrong_in_a_row = 0

    def login(self, request: Request) -> bool:
        right = self._wrong_in_a_row < 2 and super().login(request)
        self._wrong_in_a_row = 0 if right else self._wrong_in_a_row + 1
        return right

    def set_password(self, request: Request) -> bool:
        changed = super().set_password(request)
        self._wrong_in_a_row += not changed
        return changed


class SendsVersionAtConnect(ControllerCore):
    """Every connection begins with an unsolicited version (A-3-16)."""

    def _add_session(self, connection: int, carrier: Carrier) -> None:
        super()._add_session(connection, carrier)
        self.emit(self.sessions[connection], Frame(C2A, 0x08, b"1.0.0"))


@pytest.mark.parametrize(
    ("core", "only"),
    [
        (ClosesAfterReply, ("4.4/2", "4.4/4", "4.4/5")),
        (ClosesAtNextRequest, ("4.4/4",)),
        (ClosesAtNextNetwork, ("4.4/4", "4.4/5")),
        (ClosesOnMalformed, ("4.4/5", "4.5/5", "4.11/4", "4.13/5", "4.20/4", "4.21/4")),
        (RefusesFurtherLogins, ("2/12",)),
        (SendsVersionAtConnect, ("2/12", "3/29", "5.3/4")),
        (LocksOut, ("4.1/2", "4.2/3", "4.2/6")),
        (AnswersZeroBeforeLogin, ("2/11",)),
        (
            ClosesOnAnyMalformed,
            ("3/17", "4.24/3", "4.28/7", "4.32/5", "4.32/7", "4.33/3", "5.2/15"),
        ),
    ],
)
def test_open_behaviour_passes(
    run_cases: RunCases, core: type[ControllerCore], only: tuple[str, ...]
) -> None:
    """Every case of these requirements passes or is tolerated."""
    assert not run_cases(core, *only).not_passed


class AcceptsTwoClients(ControllerCore):
    """At most two connections are accepted (A-2-2)."""

    def open(self, connection: int, now_s: float, link: Carrier = "tcp") -> list[Action]:
        full = len(self.sessions) == 2
        return [Close(connection)] if full else super().open(connection, now_s, link)


def test_two_clients_are_enough(run_cases: RunCases) -> None:
    """The number of clients that are served at the same time is open (A-2-2)."""
    assert not run_cases(AcceptsTwoClients, "3/29", "3/32").not_passed


class QueuesThirdClient(ControllerCore):
    """Two clients are served; others and their requests wait until one of the two disconnects."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._waiting: dict[int, bytes] = {}

    def open(self, connection: int, now_s: float, link: Carrier = "tcp") -> list[Action]:  # noqa: ARG002 - unused
        self._waiting[connection] = b""
        return self._serve_waiting(now_s)

    def receive(self, connection: int, data: bytes, now_s: float) -> list[Action]:
        if connection not in self._waiting:
            return super().receive(connection, data, now_s)
        self._waiting[connection] += data
        return self.advance(now_s)

    def close(self, connection: int, now_s: float) -> list[Action]:
        self._waiting.pop(connection, None)
        return [*super().close(connection, now_s), *self._serve_waiting(now_s)]

    def _serve_waiting(self, now_s: float) -> list[Action]:
        actions = self.advance(now_s)
        while self._waiting and len(self.sessions) < 2:
            connection = next(iter(self._waiting))
            actions += super().open(connection, now_s)
            actions += super().receive(connection, self._waiting.pop(connection), now_s)
        return actions


class IgnoresWrongPasswords(ControllerCore):
    """A wrong password is not answered."""

    def login(self, request: Request) -> Any:
        return super().login(request) or SILENCE


def test_third_client_may_wait(run_cases: RunCases) -> None:
    """A third client may wait without a reply (A-2-2), but a client that is served must get one."""
    for core, alarms in ((QueuesThirdClient, False), (IgnoresWrongPasswords, True)):
        assert bool(run_cases(core, "4.2/4", "4.20/3", examples=20).not_passed) is alarms


class DetectsTwoDisconnectsLate(AcceptsTwoClients):
    """Like the base class, but a disconnected client is counted for 10 ms longer."""

    _DELAY_S = 0.01

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._left_s: list[float] = []

    def open(self, connection: int, now_s: float, link: Carrier = "tcp") -> list[Action]:
        self._left_s = [at_s for at_s in self._left_s if at_s > now_s - self._DELAY_S]
        if len(self.sessions) + len(self._left_s) < 2:
            return super().open(connection, now_s, link)
        self._actions.append(Close(connection))
        return self._take_actions()

    def close(self, connection: int, now_s: float) -> list[Action]:
        if connection in self.sessions:
            self._left_s.append(now_s)
        return super().close(connection, now_s)


def test_disconnect_may_be_detected_late(run_cases: RunCases) -> None:
    """A new connection may be refused shortly after another one was closed (A-2-2)."""
    assert not run_cases(
        DetectsTwoDisconnectsLate, "2/11", "2/13", "4/6", "5.2/11", "5.2/12"
    ).problems


class ClosesSomeConnections(ControllerCore):
    """Every seventh connection is closed."""

    _count = 0

    def open(self, connection: int, now_s: float, link: Carrier = "tcp") -> list[Action]:
        self._count += 1
        seventh = self._count % 7 == 0
        return [Close(connection)] if seventh else super().open(connection, now_s, link)


def test_single_client_must_be_served(run_cases: RunCases) -> None:
    """If several clients are served, a single client is always served (2/13)."""
    assert "2/13" in run_cases(ClosesSomeConnections, "2/13").violated


class ReplacesClientLate(ControllerCore):
    """The newest client is served; the previous one is closed 50 ms later (A-2-2)."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._due_s: dict[int, float] = {}

    def open(self, connection: int, now_s: float, link: Carrier = "tcp") -> list[Action]:
        for other in self.sessions:
            self._due_s.setdefault(other, now_s + 0.05)
        return super().open(connection, now_s, link)

    def receive(self, connection: int, data: bytes, now_s: float) -> list[Action]:
        return super().receive(connection, b"" if connection in self._due_s else data, now_s)

    def _process_due(self, now_s: float) -> None:
        super()._process_due(now_s)
        for connection in [c for c, due_s in self._due_s.items() if due_s <= now_s]:
            del self._due_s[connection]
            if connection in self.sessions:
                self._end(self.sessions[connection], now_s)

    @property
    def next_event_s(self) -> float | None:
        return min((*self._due_s.values(), super().next_event_s or math.inf), default=None)


@pytest.mark.parametrize("only", ["2/12", "3/18", "3/20", "4/6", "4.28/5"])
def test_replaced_client_may_be_closed_late(run_cases: RunCases, only: str) -> None:
    """The reading of the newest client is detected even if the previous connection ends late."""
    assert not run_cases(ReplacesClientLate, only).problems


class ThirdClientReplacesFirst(ControllerCore):
    """Two clients are served; a third one replaces the first (A-2-2)."""

    def open(self, connection: int, now_s: float, link: Carrier = "tcp") -> list[Action]:
        while len(self.sessions) > 1:
            self._end(next(iter(self.sessions.values())), now_s)
        return super().open(connection, now_s, link)


def test_first_of_several_clients_may_be_replaced(run_cases: RunCases) -> None:
    """If a third client replaces the first one, no case opens more than it can keep."""
    only = ("2/11", "2/12", "4.2/4", "4.20/3", "5.2/12", "5.3/7", "5.4/5")
    assert not run_cases(ThirdClientReplacesFirst, *only, examples=20).problems


class FirstClientCommands(ControllerCore):
    """Only the client that has logged in first may change anything; the others may read."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        command = BY_OPCODE.get(frame.opcode)
        others = [s.connection for s in self.sessions.values() if s.logged_in and s is not session]
        first = not others or session.connection < min(others)
        if first or not command or command.hazard is Hazard.READ_ONLY or command.name in _ALL_MAY:
            super().handle(session, frame, now_s)
        else:
            self.emit(session, Frame(C2A, frame.opcode, b"0|04" if command.two_stage else b"0"))


_ALL_MAY = ("login", "emergency_stop")


def test_only_the_first_client_may_command(run_cases: RunCases) -> None:
    """Cases with two clients are skipped (A-2-2)."""
    assert not run_cases(FirstClientCommands, "2/12", "4/6", "4/15", "4.20/3", "5.4/1").problems


class DetectsDisconnectLate(ControllerCore):
    """One client is served, and its disconnection is detected 50 ms late."""

    _left_s = -math.inf

    def open(self, connection: int, now_s: float, link: Carrier = "tcp") -> list[Action]:
        if now_s > self._left_s + 0.05:
            return super().open(connection, now_s, link)
        self._actions.append(Close(connection))
        return self._take_actions()

    def close(self, connection: int, now_s: float) -> list[Action]:
        if connection in self.sessions:
            self._left_s = now_s
        return super().close(connection, now_s)


def test_disconnect_of_the_only_client_may_be_detected_late(run_cases: RunCases) -> None:
    """If one client is served, the next one may have to connect twice."""
    cases = run_cases(DetectsDisconnectLate, "4.7/2", actual=DEFAULT.replace(max_clients="one"))
    assert cases
    assert not cases.not_passed


class SwitchesOffLate(ControllerCore):
    """A shutdown closes all connections; the robot is off half a second later (A-4.35-2)."""

    off_s = math.inf

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        super().handle(session, frame, now_s)
        if not self.powered and self.off_s == math.inf:
            self.off_s = now_s + 0.5

    def open(self, connection: int, now_s: float, link: Carrier = "tcp") -> list[Action]:
        self.powered = now_s < self.off_s
        return super().open(connection, now_s, link)


def test_connection_before_switch_off_is_not_a_restart(run_cases: RunCases) -> None:
    """A connection that is served before the robot is off is not taken as a restart."""
    cases = run_cases(SwitchesOffLate, "4.35/2")
    assert not cases.not_passed
    assert cases["4.35/2"].verdict is Verdict.TOLERATED


class LeaksTheStatus(ControllerCore):
    """The reply to a request for the status is sent to every client."""

    def get_status(self, request: Request) -> Any:
        for session in self.sessions.values():
            if session is not request.session:
                self.emit(session, Frame(C2A, 0x09, self.robot.status.encode()))
        return super().get_status(request)


def test_reply_to_another_client_is_not_unsolicited(run_cases: RunCases) -> None:
    """A status that is only sent when another client requests it is a failure."""
    assert "2/12" in run_cases(LeaksTheStatus, "2/12").violated


def releases_late(places: int, release_s: float) -> type[ControllerCore]:
    """Return a controller that frees the place of a client only after a time (A-2-11)."""

    class ReleasesLate(ControllerCore):
        def __init__(self, *args: Any, **kwargs: Any) -> None:
            super().__init__(*args, **kwargs)
            self._free_s: list[float] = []

        def open(self, connection: int, now_s: float, link: Carrier = "tcp") -> list[Action]:
            self._free_s = [free_s for free_s in self._free_s if free_s > now_s]
            full = len(self.sessions) + len(self._free_s) >= places
            return [Close(connection)] if full else super().open(connection, now_s, link)

        def _remove_session(self, session: Session, now_s: float) -> None:
            super()._remove_session(session, now_s)
            self._free_s.append(now_s + release_s)

    return ReleasesLate


@pytest.mark.parametrize(
    ("places", "release_s"), [(1, 0.1), (1, 0.5), (1, 2.0), (2, 0.5), (3, 0.1), (3, 2.0)]
)
def test_place_may_be_free_only_later(run_cases: RunCases, places: int, release_s: float) -> None:
    """The next client may be refused for a time; the run reports it once."""
    core = releases_late(places, release_s)
    cases = run_cases(core, "4.1/2", "4.1/6", "4.2/3", "2/11", "2/12", "3/29")
    assert not cases.problems
    notices = [notice for notice in cases.notices if notice.startswith("a client is refused for")]
    assert len(notices) == (release_s > 0.1)


def test_place_that_stays_taken_is_a_failure(run_cases: RunCases) -> None:
    """A controller that refuses the next client for longer does not survive the case."""
    cases = run_cases(releases_late(2, 6.0), "4.1/2", "4.1/3")
    assert "4.1/2" in cases.violated
