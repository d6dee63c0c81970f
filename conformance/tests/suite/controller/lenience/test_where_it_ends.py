"""Controllers that are near to what the document leaves open, and wrong: a case still fails."""

import math
from collections.abc import Callable
from typing import Any

import pytest

from scaraspec.protocol.commands import Pose
from scaraspec.protocol.direction import A2C, C2A
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.transfer import Receiver, Sender, State
from scaraspec.virtual_controller.behaviour import SILENCE
from scaraspec.virtual_controller.behaviour.base import Silence
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Action, Request, Session

Try = Callable[..., Any]

_NO_CHUNK = Frame(C2A, 0x56, b"0")


class TakesALengthForAStart(ControllerCore):
    """A length byte of 0xAA begins a frame anew, so that the data behind it are searched."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Answer what the data hold, too."""
        if len(frame.data) != A2C.start or A2C.start not in frame.data:
            super().handle(session, frame, now_s)
            return
        begins = frame.data.index(A2C.start)
        super().handle(session, Frame(A2C, frame.data[begins + 1]), now_s)


class KnowsEverybody(ControllerCore):
    """One command is served without a login (A-4-4)."""

    opcode: int

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Serve it."""
        before, session.logged_in = (
            session.logged_in,
            session.logged_in or self.opcode == frame.opcode,
        )
        super().handle(session, frame, now_s)
        session.logged_in = before or (session.logged_in and frame.opcode == 0x01)


class LetsGo(KnowsEverybody):
    """The joints are released."""

    opcode = 0x3A


class Chooses(KnowsEverybody):
    """The default program is set."""

    opcode = 0x0E


class FollowsARefusalUp(ControllerCore):
    """A name that is refused is followed by a 0 in place of a chunk; nobody has answered one."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Send it."""
        super().handle(session, frame, now_s)
        if frame.opcode == 0x54 and session.transfer is None:
            self.emit(session, _NO_CHUNK)


class FollowsAnEndUp(ControllerCore):
    """The answer to the last chunk is answered 0."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Answer it."""
        end = session.transfer.end if session.transfer else None
        super().handle(session, frame, now_s)
        if frame.opcode == 0x56 and isinstance(end, Sender) and end.state is State.DONE:
            self.emit(session, _NO_CHUNK)


class HasNoPatience(ControllerCore):
    """An answer to a chunk is refused after twenty seconds (25 have to be survived), or to none."""

    def download_chunk(self, request: Request) -> Silence:
        """Refuse it."""
        transfer = request.session.transfer
        due_s = transfer.end.deadline_s if transfer else 0.0
        if due_s is not None and request.now_s > due_s - 10:
            self.abort_transfer(request.session)
            self.emit(request.session, _NO_CHUNK)
            return SILENCE
        return super().download_chunk(request)


class TakesPlainNames(ControllerCore):
    """A name has letters and digits."""

    def upload_name(self, request: Request) -> bool:
        """Refuse others."""
        plain: bool = request.value.partition(b".")[0].isalnum()
        return plain and super().upload_name(request)


class TakesSmallNames(TakesPlainNames):
    """Nor may they be capitals."""

    def upload_name(self, request: Request) -> bool:
        """Refuse them."""
        return request.value == request.value.lower() and super().upload_name(request)


class ListsSmallNames(TakesPlainNames):
    """They are listed in small letters."""

    def emit(self, session: Session, frame: Frame) -> None:
        """List them."""
        data = frame.data.lower() if frame.opcode == 0x0B else frame.data
        super().emit(session, frame._replace(data=data))


class MissesSizes(ControllerCore):
    """A file whose size has two bytes of zeros is taken for an empty one."""

    def upload_chunk(self, request: Request) -> Any:
        """Refuse it."""
        if request.value and not request.value.file_size & 0xFFFF:
            self.abort_transfer(request.session)
            return False
        return super().upload_chunk(request)


class Collides(ControllerCore):
    """Of names whose bytes have the same sum some are refused, as if there were no room."""

    def upload_name(self, request: Request) -> bool:
        """Refuse it."""
        there = [sum(name) % 48 for name in self.store.names()]
        collides = len(there) >= 7 and sum(request.value) % 48 in there
        return not collides and super().upload_name(request)


class TakesPathsLate(ControllerCore):
    """A name with a path in it is accepted half a second later, behind the next reply (3/24)."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self._due: list[tuple[float, Session]] = []

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Accept it later."""
        if frame.opcode == 0x50 and b"/" in frame.data:
            self._due.append((now_s + 0.5, session))
        else:
            super().handle(session, frame, now_s)

    def _process_due(self, now_s: float) -> None:
        super()._process_due(now_s)
        while self._due and self._due[0][0] <= now_s:
            self.emit(self._due.pop(0)[1], Frame(C2A, 0x50, b"1"))

    @property
    def next_event_s(self) -> float | None:
        """When an answer is due, too."""
        times_s = [super().next_event_s, *(due_s for due_s, _ in self._due)]
        return min((due_s for due_s in times_s if due_s is not None), default=None)


class MovesLate(ControllerCore):
    """A move that was refused begins a moment later, and the status says nothing of it."""

    _due_s = math.inf

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Remember when."""
        super().handle(session, frame, now_s)
        if frame.opcode == 0x39 and self.robot.task is None:
            self._due_s = now_s + 0.05

    def get_tool_coordinates(self, request: Request) -> Pose:
        """Be elsewhere then."""
        pose = super().get_tool_coordinates(request)
        return pose._replace(x=pose.x + 5) if request.now_s > self._due_s else pose


@pytest.mark.parametrize(
    ("core", "requirement"),
    [
        (TakesALengthForAStart, "3/6"),
        (LetsGo, "2/11"),
        (Chooses, "2/11"),
        (MovesLate, "4.24/3"),
        (FollowsARefusalUp, "5.3/10"),
        (FollowsAnEndUp, "5.2/13"),
        (HasNoPatience, "5.3/7"),
        (TakesSmallNames, "5.2/2"),
        (ListsSmallNames, "4.10/11"),
        (MissesSizes, "5.2/16"),
        (TakesPathsLate, "5.2/15"),
    ],
)
def test_a_fault_is_found(tried: Try, core: type[ControllerCore], requirement: str) -> None:
    """What the document forbids is not excused by what it leaves open."""
    assert requirement in tried(core, requirement).failed


@pytest.mark.parametrize("only", ["4.10/4", "5.4/2"])
def test_a_refusal_of_a_name_is_not_taken_for_want_of_room(tried: Try, only: str) -> None:
    """When a file has gone there is room for the name that was refused (A-5-21)."""
    assert "5.2/2" in tried(Collides, only).failed


class CarriesOver(ControllerCore):
    """What came of an upload that was refused stands before the next one of its connection."""

    left: tuple[Session, bytes] | None = None
    takes: Session | None = None

    def upload_chunk(self, request: Request) -> bool | Silence:
        """Keep it, as a buffer that is not cleared."""
        self.takes, transfer = request.session, request.session.transfer
        taken = super().upload_chunk(request)
        if transfer and isinstance(transfer.end, Receiver) and transfer.end.state is State.FAILED:
            self.left = request.session, transfer.end.content
        return taken

    def _write(self, name: bytes, content: bytes) -> bool:
        if self.left and self.left[0] is self.takes:
            content, self.left = self.left[1] + content, None
        return super()._write(name, content)


def test_what_a_broken_upload_left_in_its_connection(tried: Try) -> None:
    """The next upload is sent on the same connection too, if that takes one."""
    assert "5.4/6" in tried(CarriesOver, "5.4/6").failed


class AwaitsTheAnswerAlone(ControllerCore):
    """While it sends a file, what came together with something else is no answer to a chunk."""

    alone = True

    def receive(self, connection: int, data: bytes, now_s: float) -> list[Action]:
        """See whether it comes alone: five bytes, or less."""
        self.alone = len(data) <= 5
        return super().receive(connection, data, now_s)

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Pass over an answer that does not."""
        if frame.opcode != 0x56 or self.alone:
            super().handle(session, frame, now_s)


def test_an_answer_to_a_chunk_that_does_not_come_alone(tried: Try) -> None:
    """It comes in one segment with questions, and is taken all the same."""
    assert "2/6" in tried(AwaitsTheAnswerAlone, "5.4/8").failed
    assert not tried(ControllerCore, "5.4/8").alarms
