"""Controllers that transfer files in ways of their own, which the register lists or leaves open.

No case of the suite may fail of them, nor may the judge that watches it.
"""

import math
from collections.abc import Callable
from typing import Any

import pytest

from scaraspec.judge.requirements import REQUIREMENTS
from scaraspec.judge.verdicts import Verdict
from scaraspec.protocol.direction import C2A
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.hazard import Hazard
from scaraspec.protocol.readings import DEFAULT, Dialect
from scaraspec.protocol.transfer import FILE_DATA, Chunk, Receiver, Sender, State
from scaraspec.virtual_controller.behaviour import SILENCE
from scaraspec.virtual_controller.behaviour.base import Silence
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.plant import Plant
from scaraspec.virtual_controller.session import Action, Carrier, OpenTransfer, Request, Session
from scaraspec.virtual_controller.store import Store

Try = Callable[..., Any]

_TURN_S = 0.01
_HASTE: dict[str, Any] = {"dialect": DEFAULT.replace(xfer_timeout="1"), "claimed": {"xfer_timeout"}}


class RefusesAnswers(ControllerCore):
    """An answer to a chunk that it has not sent, or has given up, is answered 0."""

    def download_chunk(self, request: Request) -> Silence:
        """Refuse it."""
        transfer = request.session.transfer
        if transfer is None or not isinstance(transfer.end, Sender):
            self.emit(request.session, Frame(C2A, request.frame.opcode, b"0"))
            return SILENCE
        return super().download_chunk(request)


class IgnoresStrayChunks(ControllerCore):
    """A chunk without an upload is not answered (A-5-16)."""

    def upload_chunk(self, request: Request) -> bool | Silence:
        """Ignore it."""
        return super().upload_chunk(request) if request.session.transfer else SILENCE


def test_a_late_chunk_may_be_ignored(tried: Try) -> None:
    """Waiting for its answer disturbs no other upload, short as the limit may be."""
    assert not tried(IgnoresStrayChunks, "5.4/5", **_HASTE).alarms


def test_a_chunk_elsewhere_may_be_ignored(tried: Try) -> None:
    """It is not waited for so long that the upload itself is given up."""
    assert not tried(IgnoresStrayChunks, "5.2/11", **_HASTE).alarms


class EndsTheLink(ControllerCore):
    """A chunk out of bounds ends the link; so does a download of which a chunk was refused."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """End it."""
        end = session.transfer.end if session.transfer else None
        chunk = FILE_DATA.decode(frame.data).value if frame.opcode == 0x52 else None
        if isinstance(end, Receiver) and isinstance(chunk, Chunk) and not chunk.legal:
            self._end(session, now_s)
            return
        super().handle(session, frame, now_s)
        if isinstance(end, Sender) and end.state is State.FAILED:
            self._end(session, now_s)


def test_a_failed_transfer_may_end_its_link(tried: Try) -> None:
    """On a new connection all goes on (A-5-26)."""
    only = ("5.2/6", "5.3/9", "5.4/6", "5.4/8")
    assert not tried(EndsTheLink, *only).alarms


class IsSmall(ControllerCore):
    """It has room for eight files, and for 40,000 bytes in all."""

    def __init__(self, plant: Plant, store: Store, *others: Any) -> None:
        super().__init__(plant, store, *others)
        self.store = Store(max_bytes=40_000, max_files=8)


def test_room_may_be_little(tried: Try) -> None:
    """How many files there may be, and how large, is nowhere said (A-5-21, A-5-25)."""
    assert not tried(IsSmall, "3/6", "5.1/7", "5.2/10", "5.2/16", "5.4/2").alarms


@pytest.mark.parametrize("kept", ["remove", "keep"])
def test_room_may_be_little_for_what_is_drawn(tried: Try, kept: str) -> None:
    """What one example has left, whole or broken off, is deleted before there are too many."""
    spoken, only = DEFAULT.replace(partial_keep=kept), ("5.1/8", "5.1/12", "5.2/10", "5.4/4")
    assert not tried(IsSmall, *only, "5.4/5", spoken=spoken, examples=10).alarms


class TakesPlainNames(ControllerCore):
    """A name has letters, digits and one dot."""

    def upload_name(self, request: Request) -> bool:
        """Refuse others."""
        stem, _, extension = request.value.partition(b".")
        plain: bool = stem.isalnum() and extension.isalpha()
        return plain and super().upload_name(request)


def test_names_may_be_plain(tried: Try) -> None:
    """Which characters a name may have is open (A-5-20)."""
    assert not tried(TakesPlainNames, "5.2/2", "5.2/11").alarms


class WritesSlowly(ControllerCore):
    """A chunk is answered when it is written, which takes six seconds."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self._written: list[tuple[float, Session]] = []

    def upload_chunk(self, request: Request) -> bool | Silence:
        """Answer it later."""
        taken = super().upload_chunk(request)
        if taken is not True:
            return taken
        self._written.append((request.now_s + 6.0, request.session))
        return SILENCE

    def _process_due(self, now_s: float) -> None:
        super()._process_due(now_s)
        while self._written and self._written[0][0] <= now_s:
            self.emit(self._written.pop(0)[1], Frame(C2A, 0x52, b"1"))

    @property
    def next_event_s(self) -> float | None:
        """When a chunk is written, too."""
        times_s = [super().next_event_s, *(at_s for at_s, _ in self._written)]
        return min((at_s for at_s in times_s if at_s is not None), default=None)


def test_an_answer_to_a_chunk_may_take_its_time(tried: Try) -> None:
    """It is waited for as long as the document says (L763)."""
    assert not tried(WritesSlowly, "5.2/6", "5.1/8").alarms


class LooksInTurns(ControllerCore):
    """Looks after its connections every 10 ms, one behind the other: the last client's first."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self._waiting: list[tuple[float, Session, Frame]] = []

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Let the answers to chunks wait, behind which nothing has come from this client."""
        self._look(now_s, behind=session)
        if frame.opcode == 0x56:
            self._waiting.append((now_s, session, frame))
        else:
            super().handle(session, frame, now_s)

    def _look(self, now_s: float, behind: Session | None = None) -> None:
        waiting, self._waiting = self._waiting, []
        for came_s, session, frame in waiting:
            if session is behind or now_s >= came_s + _TURN_S:
                super().handle(session, frame, now_s)
            else:
                self._waiting.append((came_s, session, frame))

    def _process_due(self, now_s: float) -> None:
        super()._process_due(now_s)
        self._look(now_s)

    @property
    def next_event_s(self) -> float | None:
        """When it looks again, too."""
        times_s = [super().next_event_s, *(came_s + _TURN_S for came_s, *_ in self._waiting)]
        return min((at_s for at_s in times_s if at_s is not None), default=None)


def test_a_download_may_end_at_the_next_look(tried: Try) -> None:
    """Until then another client's deletion is refused: the file is in transfer (A-4.11-1)."""
    only = ("3/31", "5.2/12", "4.11/2")
    assert not tried(LooksInTurns, *only, examples=20).alarms


class TransfersOneAtATime(LooksInTurns):
    """While any client transfers a file, no other one begins to (A-5-17)."""

    def _can_begin(self, session: Session) -> bool:
        others = (other for other in self.sessions.values() if other is not session)
        return super()._can_begin(session) and not any(other.transfer for other in others)


def test_one_file_may_be_transferred_at_a_time(tried: Try) -> None:
    """A download that is over for the suite is so for the robot before another one begins."""
    only = ("3/31", "4.2/4", "5.2/12", "5.4/1")
    assert not tried(TransfersOneAtATime, *only, examples=20).alarms


class OutlivesItsConnection(ControllerCore):
    """There is room for one transfer, which ends for silence, and not with its connection."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.left: list[OpenTransfer] = []

    def _remove_session(self, session: Session, now_s: float) -> None:
        if session.transfer:
            self.left.append(session.transfer)
        super()._remove_session(session, now_s)

    def _process_due(self, now_s: float) -> None:
        super()._process_due(now_s)
        for transfer in self.left:
            transfer.end.expire(now_s)

    def _can_begin(self, session: Session) -> bool:
        others = (other.transfer for other in self.sessions.values() if other is not session)
        return super()._can_begin(session) and not any((*others, *self.under_way))

    @property
    def under_way(self) -> list[OpenTransfer]:
        """What others have left."""
        return [transfer for transfer in self.left if transfer.end.state is State.ACTIVE]


class NeverEnds(OutlivesItsConnection):
    """It ends with the robot."""

    @property
    def under_way(self) -> list[OpenTransfer]:
        """All of it."""
        return self.left


def test_a_transfer_may_outlive_its_connection(tried: Try) -> None:
    """Until its time-out nobody's file is taken, as if another client transferred one (A-5-17)."""
    only = ("4.15/5", "5.1/9", "5.2/2", "5.2/11", "5.3/7", "5.4/5", "5.4/7")
    cases = tried(OutlivesItsConnection, *only)
    assert not cases.alarms
    assert cases["5.4/7.closed"].verdict is Verdict.TOLERATED
    assert "5.2/2" in tried(NeverEnds, *only).failed


class Gathers(ControllerCore):
    """What it gathers is written 150 bytes at a time, into a file that it creates with its name;
    what is not yet written of an upload that breaks off is lost (A-5-12)."""

    def abort_transfer(self, session: Session) -> None:
        """Leave what is written."""
        transfer = session.transfer
        super().abort_transfer(session)
        if transfer is not None and isinstance(transfer.end, Receiver):
            content = transfer.end.content
            self._write(transfer.name, self.leave(content[: len(content) // 150 * 150]))

    def leave(self, written: bytes) -> bytes:
        """What becomes of it."""
        return written


class GathersNonsense(Gathers):
    """What it has written is not what came."""

    def leave(self, written: bytes) -> bytes:
        """Spoil it."""
        return written[1:]


def test_a_beginning_of_a_broken_upload_may_stay(tried: Try) -> None:
    """As much as was written, or the empty file, where such a one can be fetched, too."""
    speaks = {"dialect": _HASTE["dialect"].replace(empty_file="chunk"), "claimed": {"xfer_timeout"}}
    cases = tried(Gathers, "5.4/5", "5.4/7", **speaks)
    assert not cases.alarms
    assert cases["5.4/7.closed"].verdict is Verdict.TOLERATED
    assert "5.4/7" in tried(GathersNonsense, "5.4/7", **speaks).failed


class Beats(ControllerCore):
    """Ten times a second it tells its status, unasked (A-3-16)."""

    _every_s = 0.1
    _due_s = math.inf

    def open(self, connection: int, now_s: float, link: Carrier = "tcp") -> list[Action]:
        """Begin."""
        self._due_s = now_s + self._every_s
        return super().open(connection, now_s, link)

    def _process_due(self, now_s: float) -> None:
        super()._process_due(now_s)
        if now_s >= self._due_s:
            self._due_s = now_s + self._every_s
            for session in self.sessions.values():
                self.emit(session, Frame(C2A, 0x09, self.robot.status.encode()))

    @property
    def next_event_s(self) -> float | None:
        """The next beat, too."""
        return min(super().next_event_s or math.inf, self._due_s)


def test_what_is_told_unasked_answers_nothing(tried: Try) -> None:
    """It is no further chunk (5.3/6), nobody else's reply, nor one to an undefined opcode."""
    assert not tried(Beats, "2/12", "3/21", "5.3/7", **_HASTE, examples=1).alarms


class SaysThatItGivesUp(ControllerCore):
    """A download that has failed ends with a chunk of length 0."""

    def _process_due(self, now_s: float) -> None:
        transfers = [(session, session.transfer) for session in self.sessions.values()]
        super()._process_due(now_s)
        for session, transfer in transfers:
            if transfer is not None and session.transfer is None:
                self._signal(session, transfer.end)

    def download_chunk(self, request: Request) -> Silence:
        """Say so behind an answer that refuses a chunk, too."""
        transfer = request.session.transfer
        answer = super().download_chunk(request)
        if transfer is not None:
            self._signal(request.session, transfer.end)
        return answer

    def _signal(self, session: Session, end: Sender | Receiver) -> None:
        if isinstance(end, Sender) and end.state is State.FAILED:
            signal = FILE_DATA.encode(Chunk(end.size_bytes, 0, 0, b""), self.dialect)
            self.emit(session, Frame(C2A, 0x56, signal))


def test_a_download_may_end_with_a_signal(tried: Try) -> None:
    """It is what a chunk of length 0 means (L787), and no further chunk of the file."""
    assert not tried(SaysThatItGivesUp, "5.3/6", "5.3/7", "5.3/9", "5.4/6", **_HASTE).alarms


class AnswersTheErrorSignal(ControllerCore):
    """A chunk of length 0 ends an upload, and is answered 0 (A-5-10)."""

    def upload_chunk(self, request: Request) -> bool | Silence:
        """Answer it, whatever it ends."""
        said = super().upload_chunk(request)
        return False if said is SILENCE else said


def test_the_error_signal_may_be_answered(tried: Try) -> None:
    """Its answer is not taken for that to the first chunk of another file."""
    assert not tried(AnswersTheErrorSignal, "5.2/14", "5.2/17", "5.4/6", **_HASTE).alarms


def test_an_answer_to_no_chunk_may_be_refused(tried: Try) -> None:
    """The 0 is no chunk (A-5-16), neither for the cases nor for the judge."""
    assert not tried(RefusesAnswers, "5.3/10").alarms


@pytest.mark.parametrize("chunks", [1, 2, 3, 4])
def test_what_is_stored_may_be_short(tried: Try, chunks: int) -> None:
    """Where nothing may be sent a program of the robot's own is fetched, of whatever size."""

    class Delivered(ControllerCore):
        def __init__(self, plant: Plant, store: Store, dialect: Dialect) -> None:
            if b"demo.rob" not in store:
                store.write(b"demo.rob", bytes(200 * chunks - 25))
            super().__init__(plant, store, dialect)

    only = (r for r in REQUIREMENTS if r.startswith(("5.1/", "5.3/")))
    cases = tried(Delivered, *only, allowed=(Hazard.READ_ONLY,), examples=1)
    assert not cases.alarms
