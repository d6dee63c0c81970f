"""Controllers that let clients in, and send them away, in ways of their own, which are open."""

import math
from collections.abc import Callable
from typing import Any

import pytest

from scaraspec.judge.verdicts import Verdict
from scaraspec.protocol.direction import A2C, C2A
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.readings import DEFAULT
from scaraspec.virtual_controller.behaviour import SILENCE
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Action, Carrier, Close, Request, Session

Try = Callable[..., Any]


class CutsALittleLater(ControllerCore):
    """A new network is answered, and the connection ends while the next is asked."""

    asked = frozenset(range(0x100))

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._doomed: set[int] = set()

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """End it."""
        if session.connection in self._doomed and frame.opcode in self.asked:
            self._end(session, now_s)
            return
        super().handle(session, frame, now_s)
        if frame.opcode == 0x05:
            self._doomed.add(session.connection)


class CutsALotLater(CutsALittleLater):
    """It ends while the next network is set."""

    asked = frozenset({0x05})


class CutsBehindTheReply(ControllerCore):
    """A new network is answered, and then the connection ends."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """End it."""
        super().handle(session, frame, now_s)
        if frame.opcode == 0x05 and self._value(self._command(frame), frame) is not None:  # type: ignore[arg-type] # it has a row
            self._end(session, now_s)


class ClosesOnMalformed(ControllerCore):
    """A request that says nothing usable ends its connection."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """End it."""
        command = self._command(frame)
        asks = command and command.request.fields and not command.two_stage
        if command and asks and command.initiator is A2C and self._value(command, frame) is None:
            self._end(session, now_s)
        else:
            super().handle(session, frame, now_s)


class ClosesOnAnyMalformed(ControllerCore):
    """As before, and commands that move the arm are no exception."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """End it."""
        command = self._command(frame)
        spoilt = command and frame.data and self._value(command, frame) is None
        if command and spoilt and command.initiator is A2C:
            self._end(session, now_s)
        else:
            super().handle(session, frame, now_s)


class RefusesFurtherLogins(ControllerCore):
    """While one client is logged in the password opens to no other one (A-2-2)."""

    def login(self, request: Request) -> bool:
        """Refuse it."""
        others = [each for each in self.sessions.values() if each is not request.session]
        return not any(each.logged_in for each in others) and super().login(request)


class AnswersZeroToStrangers(ControllerCore):
    """Whatever comes before the login is answered 0 (A-4-4)."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Answer it."""
        if session.logged_in or frame.opcode == 0x01:
            super().handle(session, frame, now_s)
        else:
            self.emit(session, Frame(C2A, frame.opcode, b"0"))


class LocksOut(ControllerCore):
    """Two wrong passwords in a row, and nobody gets in any more (A-4.1-2)."""

    _row = 0

    def login(self, request: Request) -> bool:
        """Count them."""
        right = self._row < 2 and super().login(request)
        self._row = 0 if right else self._row + 1
        return right

    def set_password(self, request: Request) -> bool:
        """Here, too."""
        changed = super().set_password(request)
        self._row += not changed
        return changed


class Greets(ControllerCore):
    """Every connection begins with the version (A-3-16)."""

    def _add_session(self, connection: int, carrier: Carrier) -> None:
        super()._add_session(connection, carrier)
        self.emit(self.sessions[connection], Frame(C2A, 0x08, b"1.0.0"))


@pytest.mark.parametrize(
    ("core", "only"),
    [
        (CutsBehindTheReply, ("4.4/2", "4.4/4", "4.4/5")),
        (CutsALittleLater, ("4.4/4",)),
        (CutsALotLater, ("4.4/4", "4.4/5")),
        (ClosesOnMalformed, ("4.4/5", "4.5/5", "4.11/4", "4.13/5", "4.20/4", "4.21/4")),
        (RefusesFurtherLogins, ("2/12",)),
        (Greets, ("2/12", "3/29", "5.3/4")),
        (LocksOut, ("4.1/2", "4.2/3", "4.2/6")),
        (AnswersZeroToStrangers, ("2/11",)),
        (
            ClosesOnAnyMalformed,
            ("3/17", "4.24/3", "4.28/7", "4.32/5", "4.32/7", "4.33/3", "5.2/15"),
        ),
    ],
)
def test_what_is_open_is_not_failed(
    tried: Try, core: type[ControllerCore], only: tuple[str, ...]
) -> None:
    """Every case of these requirements passes or is tolerated."""
    assert not tried(core, *only).wrong


class ServesTwo(ControllerCore):
    """More clients than two are refused (A-2-2)."""

    def open(self, connection: int, now_s: float, link: Carrier = "tcp") -> list[Action]:
        """Refuse them."""
        most = 2
        full = len(self.sessions) == most
        return [Close(connection)] if full else super().open(connection, now_s, link)


def test_a_few_clients_are_enough(tried: Try) -> None:
    """How many clients are served at once is open (A-2-2)."""
    assert not tried(ServesTwo, "3/29", "3/32").wrong


class LetsTwoIn(ControllerCore):
    """Others wait at the door, and what they send with them, until one of the two leaves."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._waiting: dict[int, bytes] = {}

    def open(self, connection: int, now_s: float, link: Carrier = "tcp") -> list[Action]:  # noqa: ARG002 - all are of one kind here
        """Let in as many as there is room for."""
        self._waiting[connection] = b""
        return self._let_in(now_s)

    def receive(self, connection: int, data: bytes, now_s: float) -> list[Action]:
        """Hear who is in."""
        if connection not in self._waiting:
            return super().receive(connection, data, now_s)
        self._waiting[connection] += data
        return self.advance(now_s)

    def close(self, connection: int, now_s: float) -> list[Action]:
        """Make room."""
        self._waiting.pop(connection, None)
        return [*super().close(connection, now_s), *self._let_in(now_s)]

    def _let_in(self, now_s: float) -> list[Action]:
        actions = self.advance(now_s)
        while self._waiting and len(self.sessions) < 2:
            connection = next(iter(self._waiting))
            actions += super().open(connection, now_s)
            actions += super().receive(connection, self._waiting.pop(connection), now_s)
        return actions


class IgnoresWrongPasswords(ControllerCore):
    """Who does not know the password is not answered."""

    def login(self, request: Request) -> Any:
        """Keep silent."""
        return super().login(request) or SILENCE


def test_who_is_not_let_in_is_not_answered(tried: Try) -> None:
    """A third client may wait at the door (A-2-2); one that is served is answered."""
    for core, alarms in ((LetsTwoIn, False), (IgnoresWrongPasswords, True)):
        assert bool(tried(core, "4.2/4", "4.20/3", examples=20).wrong) is alarms


class FreesLate(ServesTwo):
    """As before, and a client that has left keeps its place for another moment."""

    _LATE_S = 0.01

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._left_s: list[float] = []

    def open(self, connection: int, now_s: float, link: Carrier = "tcp") -> list[Action]:
        """Look which places are taken."""
        self._left_s = [at_s for at_s in self._left_s if at_s > now_s - self._LATE_S]
        if len(self.sessions) + len(self._left_s) < 2:
            return super().open(connection, now_s, link)
        self._actions.append(Close(connection))
        return self._take_actions()

    def close(self, connection: int, now_s: float) -> list[Action]:
        """Remember when."""
        if connection in self.sessions:
            self._left_s.append(now_s)
        return super().close(connection, now_s)


def test_a_place_may_be_free_a_moment_later(tried: Try) -> None:
    """Who served two, and has not yet seen them leave, sends the next one away (A-2-2)."""
    assert not tried(FreesLate, "2/11", "2/13", "4/6", "5.2/11", "5.2/12").alarms


class SendsSomeAway(ControllerCore):
    """Every seventh client is sent away, whoever is there."""

    _count = 0

    def open(self, connection: int, now_s: float, link: Carrier = "tcp") -> list[Action]:
        """Count them."""
        self._count += 1
        seventh = self._count % 7 == 0
        return [Close(connection)] if seventh else super().open(connection, now_s, link)


def test_a_place_is_not_taken_by_nobody(tried: Try) -> None:
    """Where several are served, who comes alone is served (2/13)."""
    assert "2/13" in tried(SendsSomeAway, "2/13").failed


class DisplacesAMomentLater(ControllerCore):
    """The newest client is served; a moment later the one before is sent away (A-2-2)."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._due_s: dict[int, float] = {}

    def open(self, connection: int, now_s: float, link: Carrier = "tcp") -> list[Action]:
        """Remember whom to send away."""
        for other in self.sessions:
            self._due_s.setdefault(other, now_s + 0.05)
        return super().open(connection, now_s, link)

    def receive(self, connection: int, data: bytes, now_s: float) -> list[Action]:
        """Serve only the newest."""
        return super().receive(connection, b"" if connection in self._due_s else data, now_s)

    def _process_due(self, now_s: float) -> None:
        super()._process_due(now_s)
        for connection in [c for c, due_s in self._due_s.items() if due_s <= now_s]:
            del self._due_s[connection]
            if connection in self.sessions:
                self._end(self.sessions[connection], now_s)

    @property
    def next_event_s(self) -> float | None:
        """When the next one is sent away."""
        return min((*self._due_s.values(), super().next_event_s or math.inf), default=None)


@pytest.mark.parametrize("only", ["2/12", "3/18", "3/20", "4/6", "4.28/5"])
def test_who_is_displaced_may_be_sent_away_a_moment_later(tried: Try, only: str) -> None:
    """That the newest client wins is found out although the one before is not gone at once."""
    assert not tried(DisplacesAMomentLater, only).alarms


class DisplacesTheFirstOfTwo(ControllerCore):
    """Two clients are served; a third one takes the place of the first (A-2-2)."""

    def open(self, connection: int, now_s: float, link: Carrier = "tcp") -> list[Action]:
        """Send the first of two away."""
        while len(self.sessions) > 1:
            self._end(next(iter(self.sessions.values())), now_s)
        return super().open(connection, now_s, link)


def test_the_first_of_several_may_be_displaced(tried: Try) -> None:
    """Where a third client displaces the first, no case has more than one."""
    only = ("2/11", "2/12", "4.2/4", "4.20/3", "5.2/12", "5.3/7", "5.4/5")
    assert not tried(DisplacesTheFirstOfTwo, *only, examples=20).alarms


class NoticesLate(ControllerCore):
    """Of one client it notices a moment late that it has gone, and serves no other till then."""

    _left_s = -math.inf

    def open(self, connection: int, now_s: float, link: Carrier = "tcp") -> list[Action]:
        """Look who is there."""
        if now_s > self._left_s + 0.05:
            return super().open(connection, now_s, link)
        self._actions.append(Close(connection))
        return self._take_actions()

    def close(self, connection: int, now_s: float) -> list[Action]:
        """Remember when."""
        if connection in self.sessions:
            self._left_s = now_s
        return super().close(connection, now_s)


def test_who_notices_late_that_a_client_has_gone(tried: Try) -> None:
    """The next client of a robot that serves one may have to come twice, from the beginning on."""
    cases = tried(NoticesLate, "4.7/2", spoken=DEFAULT.replace(max_clients="one"))
    assert cases
    assert not cases.wrong


class GoesSlowly(ControllerCore):
    """Shut down, it ends its connections at once, and itself half a second later (A-4.35-2)."""

    gone_s = math.inf

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Remember when it will be gone."""
        super().handle(session, frame, now_s)
        if not self.powered and self.gone_s == math.inf:
            self.gone_s = now_s + 0.5

    def open(self, connection: int, now_s: float, link: Carrier = "tcp") -> list[Action]:
        """Serve whoever comes in between."""
        self.powered = now_s < self.gone_s
        return super().open(connection, now_s, link)


def test_a_robot_that_serves_a_last_client_while_it_goes_has_not_returned(tried: Try) -> None:
    """Nothing needs to be put back: it was, before the shutdown."""
    cases = tried(GoesSlowly, "4.35/2")
    assert not cases.wrong
    assert cases["4.35/2"].verdict is Verdict.TOLERATED


class LeaksTheStatus(ControllerCore):
    """Who asks for the status has it told to every client."""

    def get_status(self, request: Request) -> Any:
        for session in self.sessions.values():
            if session is not request.session:
                self.emit(session, Frame(C2A, 0x09, self.robot.status.encode()))
        return super().get_status(request)


def test_a_status_that_another_client_asked_for_is_not_told_of_itself(tried: Try) -> None:
    """It is held against a robot that has not told it before."""
    assert "2/12" in tried(LeaksTheStatus, "2/12").failed
