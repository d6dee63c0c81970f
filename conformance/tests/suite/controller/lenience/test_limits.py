"""Faulty controllers that are similar to a conforming reading: a case still fails."""

import math
from collections.abc import Callable
from typing import Any

import pytest

from scaraspec.protocol.commands import Pose
from scaraspec.protocol.direction import A2C, C2A
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.transfer import Receiver, Sender, TransferState
from scaraspec.virtual_controller.behaviour import SILENCE
from scaraspec.virtual_controller.behaviour.base import Silence
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Action, Request, Session

RunCases = Callable[..., Any]

_ZERO = Frame(C2A, 0x56, b"0")


class TreatsLengthAsStart(ControllerCore):
    """A length byte of 0xAA starts another frame, so that the data after it are parsed."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        if len(frame.data) != A2C.start or A2C.start not in frame.data:
            super().handle(session, frame, now_s)
            return
        start = frame.data.index(A2C.start)
        super().handle(session, Frame(A2C, frame.data[start + 1]), now_s)


class ServesWithoutLogin(ControllerCore):
    """One command is served without a login (A-4-4)."""

    opcode: int

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        before, session.logged_in = (
            session.logged_in,
            session.logged_in or self.opcode == frame.opcode,
        )
        super().handle(session, frame, now_s)
        session.logged_in = before or (session.logged_in and frame.opcode == 0x01)


class ReleasesWithoutLogin(ServesWithoutLogin):
    """The joints can be released without a login."""

    opcode = 0x3A


class SetsDefaultWithoutLogin(ServesWithoutLogin):
    """The default program can be set without a login."""

    opcode = 0x0E


class SendsZeroAfterRefusal(ControllerCore):
    """A refused name is followed by a 0 with the opcode of chunks, although no chunk was sent."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        super().handle(session, frame, now_s)
        if frame.opcode == 0x54 and session.transfer is None:
            self.emit(session, _ZERO)


class AnswersLastAnswer(ControllerCore):
    """The answer to the last chunk is answered 0."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        end = session.transfer.end if session.transfer else None
        super().handle(session, frame, now_s)
        if frame.opcode == 0x56 and isinstance(end, Sender) and end.state is TransferState.DONE:
            self.emit(session, _ZERO)


class TimesOutEarly(ControllerCore):
    """A download is aborted after 20 s of silence; 25 s must be allowed."""

    def download_chunk(self, request: Request) -> Silence:
        transfer = request.session.transfer
        due_s = transfer.end.deadline_s if transfer else 0.0
        if due_s is not None and request.now_s > due_s - 10:
            self.abort_transfer(request.session)
            self.emit(request.session, _ZERO)
            return SILENCE
        return super().download_chunk(request)


class AcceptsPlainNames(ControllerCore):
    """Only letters and digits are accepted in a name."""

    def upload_name(self, request: Request) -> bool:
        plain: bool = request.value.partition(b".")[0].isalnum()
        return plain and super().upload_name(request)


class AcceptsLowercaseNames(AcceptsPlainNames):
    """Capital letters are not accepted in a name."""

    def upload_name(self, request: Request) -> bool:
        return request.value == request.value.lower() and super().upload_name(request)


class ListsLowercaseNames(AcceptsPlainNames):
    """Names are listed in lower case."""

    def emit(self, session: Session, frame: Frame) -> None:
        data = frame.data.lower() if frame.opcode == 0x0B else frame.data
        super().emit(session, frame._replace(data=data))


class TreatsSomeSizesAsEmpty(ControllerCore):
    """A file whose size has two zero bytes is treated as empty."""

    def upload_chunk(self, request: Request) -> Any:
        if request.value and not request.value.file_size & 0xFFFF:
            self.abort_transfer(request.session)
            return False
        return super().upload_chunk(request)


class RefusesCollidingNames(ControllerCore):
    """Names with the same sum of bytes are refused as if there were no room."""

    def upload_name(self, request: Request) -> bool:
        sums = [sum(name) % 48 for name in self.store.names()]
        collides = len(sums) >= 7 and sum(request.value) % 48 in sums
        return not collides and super().upload_name(request)


class AcceptsPathsLate(ControllerCore):
    """A name with a path is accepted half a second later, after the next reply (3/24)."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self._due: list[tuple[float, Session]] = []

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
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
        times_s = [super().next_event_s, *(due_s for due_s, _ in self._due)]
        return min((due_s for due_s in times_s if due_s is not None), default=None)


class MovesLate(ControllerCore):
    """A refused move starts later, and the status does not show it."""

    _due_s = math.inf

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        super().handle(session, frame, now_s)
        if frame.opcode == 0x39 and self.robot.task is None:
            self._due_s = now_s + 0.05

    def get_tool_coordinates(self, request: Request) -> Pose:
        pose = super().get_tool_coordinates(request)
        return pose._replace(x=pose.x + 5) if request.now_s > self._due_s else pose


@pytest.mark.parametrize(
    ("core", "requirement"),
    [
        (TreatsLengthAsStart, "3/6"),
        (ReleasesWithoutLogin, "2/11"),
        (SetsDefaultWithoutLogin, "2/11"),
        (MovesLate, "4.24/3"),
        (SendsZeroAfterRefusal, "5.3/10"),
        (AnswersLastAnswer, "5.2/13"),
        (TimesOutEarly, "5.3/7"),
        (AcceptsLowercaseNames, "5.2/2"),
        (ListsLowercaseNames, "4.10/11"),
        (TreatsSomeSizesAsEmpty, "5.2/16"),
        (AcceptsPathsLate, "5.2/15"),
    ],
)
def test_fault_is_detected(
    run_cases: RunCases, core: type[ControllerCore], requirement: str
) -> None:
    """An open point does not hide what the document forbids."""
    assert requirement in run_cases(core, requirement, fail_fast=True).violated


@pytest.mark.parametrize("only", ["4.10/4", "5.4/2"])
def test_refused_name_is_retried_with_more_room(run_cases: RunCases, only: str) -> None:
    """After a file is deleted, there is room for the refused name (A-5-21)."""
    assert "5.2/2" in run_cases(RefusesCollidingNames, only).violated


class PrependsRefusedUpload(ControllerCore):
    """The content of a refused upload is prepended to the next upload of the same connection."""

    leftover: tuple[Session, bytes] | None = None
    current: Session | None = None

    def upload_chunk(self, request: Request) -> bool | Silence:
        self.current, transfer = request.session, request.session.transfer
        taken = super().upload_chunk(request)
        if (
            transfer
            and isinstance(transfer.end, Receiver)
            and transfer.end.state is TransferState.FAILED
        ):
            self.leftover = request.session, transfer.end.content
        return taken

    def _write(self, name: bytes, content: bytes) -> bool:
        if self.leftover and self.leftover[0] is self.current:
            content, self.leftover = self.leftover[1] + content, None
        return super()._write(name, content)


def test_leftover_of_an_interrupted_upload_is_detected(run_cases: RunCases) -> None:
    """The next upload uses the same connection, if it is accepted there."""
    assert "5.4/6" in run_cases(PrependsRefusedUpload, "5.4/6").violated


class NeedsAnswerInOwnSegment(ControllerCore):
    """An answer to a chunk is ignored if its segment contains other bytes."""

    alone = True

    def receive(self, connection: int, data: bytes, now_s: float) -> list[Action]:
        self.alone = len(data) <= 5
        return super().receive(connection, data, now_s)

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        if frame.opcode != 0x56 or self.alone:
            super().handle(session, frame, now_s)


def test_answer_in_a_shared_segment(run_cases: RunCases) -> None:
    """An answer to a chunk must be accepted in one segment with queries."""
    assert "2/6" in run_cases(NeedsAnswerInOwnSegment, "5.4/8").violated
    assert not run_cases(ControllerCore, "5.4/8").problems
