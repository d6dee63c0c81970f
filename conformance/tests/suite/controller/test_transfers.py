"""Controllers that transfer files differently from the virtual controller pass clause 5."""

import itertools
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import pytest

from scaraspec.judge.requirements import select
from scaraspec.judge.verdicts import Verdict
from scaraspec.mutants.controller_run import PASSWORD, Robot
from scaraspec.mutants.operators.controller.transfers import chunk_data, receives
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.readings import DEFAULT, Dialect
from scaraspec.protocol.transfer import FILE_DATA, Chunk, Receiver, Sender, TransferState
from scaraspec.suite.controller.harness.access import MemoryAccess
from scaraspec.suite.controller.harness.adapter import ControllerAdapter
from scaraspec.suite.engine.ics import Ics
from scaraspec.suite.engine.plan import ALL, Options
from scaraspec.suite.engine.run import Run
from scaraspec.transports.link import Link
from scaraspec.virtual_controller.behaviour.base import SILENCE, Silence
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Action, Carrier, OpenTransfer, Request, Session

CLAUSES = ("5.1", "5.2", "5.3", "5.4")
ONLY = frozenset(r.id for clause in CLAUSES for r in select(clause)) - {"5.2/16"}  # takes long
UPLOAD_CHUNK, DOWNLOAD_CHUNK = 0x52, 0x56
REFUSED = b"\xcc\x52\x010\xaa"


class DelaysReplies(ControllerCore):
    """Every reply is sent 0.3 s late."""

    now_s = 0.0

    @cached_property
    def pending(self) -> list[tuple[float, Session, bytes]]:
        return []

    @property
    def next_event_s(self) -> float | None:
        times_s = [due_s for due_s, _, _ in self.pending]
        soonest_s = super().next_event_s
        return min(times_s + ([] if soonest_s is None else [soonest_s]), default=None)

    def open(self, connection: int, now_s: float, link: Carrier = "tcp") -> list[Action]:
        self.now_s = now_s
        return super().open(connection, now_s, link)

    def receive(self, connection: int, data: bytes, now_s: float) -> list[Action]:
        self.now_s = now_s
        return super().receive(connection, data, now_s)

    def transmit(self, session: Session, data: bytes) -> None:
        self.pending.append((self.now_s + 0.3, session, data))

    def advance(self, now_s: float) -> list[Action]:
        self.now_s = now_s
        due = [entry for entry in self.pending if entry[0] <= now_s]
        for entry in due:
            self.pending.remove(entry)
            super().transmit(*entry[1:])
        return super().advance(now_s)


class ClosesAfterFailedUpload(ControllerCore):
    """The connection of a failed upload is closed (A-5-26)."""

    def _uploads(self) -> list[Session]:
        sessions = self.sessions.values()
        return [s for s in sessions if s.transfer and isinstance(s.transfer.end, Receiver)]

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        uploads = session in self._uploads()
        super().handle(session, frame, now_s)
        if uploads and [action.data for action in self._actions[-1:]] == [REFUSED]:
            self._end(session, now_s)

    def _process_due(self, now_s: float) -> None:
        uploads = self._uploads()
        super()._process_due(now_s)
        for session in uploads:
            if session.transfer is None and session.connection in self.sessions:
                self._end(session, now_s)


class IgnoresStrayChunks(ControllerCore):
    """A chunk without an upload is not answered (A-5-16)."""

    def upload_chunk(self, request: Request) -> bool | Silence:
        stray = request.session.transfer is None
        return SILENCE if stray else super().upload_chunk(request)


class _ContinuesAfterRefusal(Receiver):
    """A refused chunk does not abort the upload (A-5-14)."""

    def receive_chunk(self, data: bytes, now_s: float) -> bool | None:
        taken = super().receive_chunk(data, now_s)
        if taken is False:
            self.state = TransferState.ACTIVE
        return taken


class RepeatsRefusedChunks(ControllerCore):
    """A chunk that the client refused is sent again (A-5-14)."""

    def download_chunk(self, request: Request) -> Silence:
        transfer = request.session.transfer
        if request.value is False and transfer and isinstance(transfer.end, Sender):
            content, at = self.store.read(transfer.name), transfer.end.acknowledged_bytes
            piece = content[at : at + 200]
            self._send_chunk(request.session, Chunk(len(content), at, len(piece), piece))
            return SILENCE
        return super().download_chunk(request)


class OneTransferAtATime(ControllerCore):
    """Only one transfer is possible on all connections together (A-5-17)."""

    def _can_begin(self, session: Session) -> bool:
        busy = any(other.transfer for other in self.sessions.values())
        return not busy and super()._can_begin(session)


class UploadOutlivesConnection(ControllerCore):
    """An upload whose connection ended blocks its name until the timeout (L795)."""

    @cached_property
    def lost(self) -> list[tuple[float, OpenTransfer]]:
        return []

    def close(self, connection: int, now_s: float) -> list[Action]:
        session = self.sessions.get(connection)
        transfer = session.transfer if session else None
        if transfer and isinstance(transfer.end, Receiver):
            self.lost.append((transfer.end.deadline_s or math.inf, transfer))
        return super().close(connection, now_s)

    def upload_name(self, request: Request) -> bool:
        blocked = any(
            transfer.name == request.value and due_s > request.now_s
            for due_s, transfer in self.lost
        )
        return not blocked and super().upload_name(request)


def _with_old_data(chunk: Chunk, _: Dialect) -> bytes:
    """Return a chunk whose buffer contains old data after the valid bytes (A-5-4)."""
    return FILE_DATA.encode(chunk._replace(buffer=chunk.buffer.ljust(200, b"\xaa")))


class SmallChunks(ControllerCore):
    """A chunk contains at most 100 bytes."""

    @cached_property
    def halves(self) -> dict[Session, Chunk]:
        return {}

    def _send_chunk(self, session: Session, chunk: Chunk) -> None:
        first, rest = chunk.data[:100], chunk.data[100:]
        if rest:
            self.halves[session] = chunk._replace(
                position=chunk.position + 100, length=len(rest), buffer=rest
            )
        super()._send_chunk(session, chunk._replace(length=len(first), buffer=first))

    def download_chunk(self, request: Request) -> Silence:
        half = self.halves.pop(request.session, None)
        if half is None or not request.value or request.session.transfer is None:
            return super().download_chunk(request)
        transfer = request.session.transfer
        assert isinstance(transfer.end, Sender)
        transfer.end._last_frame_s = request.now_s
        super()._send_chunk(request.session, half)
        return SILENCE


class ShortNames(ControllerCore):
    """Names of more than 30 bytes are refused (A-5-20)."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        if frame.opcode == 0x50 and len(frame.data) > 30:
            frame = frame._replace(data=b"")
        super().handle(session, frame, now_s)


class _AcceptsRepeatedChunks(Receiver):
    """A repeated chunk is accepted and ignored (A-5-8)."""

    def _problem(self, chunk: Chunk) -> str:
        if chunk.legal and chunk.position < self.received_bytes:
            return ""
        return super()._problem(chunk)

    def receive_chunk(self, data: bytes, now_s: float) -> bool | None:
        before, pieces = self.received_bytes, dict(self._pieces)
        taken = super().receive_chunk(data, now_s)
        chunk = FILE_DATA.decode(data).value
        if taken and chunk is not None and chunk.position < before:
            self._pieces, self.received_bytes = pieces, before
            self.state = TransferState.ACTIVE
        return taken


def _combined(name: str, *cores: type[ControllerCore]) -> type[ControllerCore]:
    return type(name, cores, {})


CORES = (
    DelaysReplies,
    _combined(
        "Cautious",
        SmallChunks,
        chunk_data(_with_old_data),
        ShortNames,
        receives(_AcceptsRepeatedChunks),
        OneTransferAtATime,
    ),
    _combined(
        "Forgiving",
        receives(_ContinuesAfterRefusal),
        RepeatsRefusedChunks,
        UploadOutlivesConnection,
    ),
    _combined("Strict", ClosesAfterFailedUpload, IgnoresStrayChunks),
)


@pytest.mark.parametrize("core", CORES)
def test_other_conforming_controllers_pass(
    run_cases: Callable[..., Any], core: type[ControllerCore]
) -> None:
    """Readings of the register and open points fail no case of clause 5."""
    cases = run_cases(core, *ONLY)
    assert not cases.problems
    assert len(cases) > len(ONLY) / 4


@dataclass(frozen=True)
class StallingAccess(MemoryAccess):
    """A computer that stalls for 31 s before it sends one frame with a given opcode.

    Once on each connection; with `sent`, once on all.
    """

    opcode: int = 0
    number: int = 3
    sent: Iterator[int] | None = None

    def connect(self) -> Link:
        link, sent = super().connect(), self.sent or itertools.count(1)
        send = link.send

        def stall(data: bytes) -> int:
            if data[1] == self.opcode and next(sent) == self.number:
                self.pause(31)
            return send(data)

        link.send = stall  # type: ignore[method-assign]  # of this one link
        return link


def test_a_case_is_repeated_after_a_delay() -> None:
    """A computer that was slow once costs no verdict."""
    access = StallingAccess(
        Robot(ControllerCore, DEFAULT).network, opcode=UPLOAD_CHUNK, sent=itertools.count(1)
    )
    options = Options(only=frozenset({"5.2/16"}), allowed=ALL)
    results = Run(ControllerAdapter(access, Ics(), PASSWORD, options)).results()
    (repeated,) = (case for case in results.cases if case.attempts)
    assert repeated.verdict is Verdict.PASS
    assert str(repeated.attempts[0].message) == (
        "this machine is too slow: the suite was silent for 31.000 s"
    )


@pytest.mark.parametrize(
    ("opcode", "number", "requirement"),
    [
        (UPLOAD_CHUNK, 3, "5.2/16"),
        (UPLOAD_CHUNK, 7, "5.2/16"),  # the first chunk of a large file, after three small files
        (UPLOAD_CHUNK, 3, "5.4/4"),
        (UPLOAD_CHUNK, 4, "5.4/8"),
        (DOWNLOAD_CHUNK, 1, "4.7/4"),
        (DOWNLOAD_CHUNK, 3, "5.1/8"),
        (DOWNLOAD_CHUNK, 3, "5.1/9"),
    ],
)
def test_slow_computer_is_inconclusive(opcode: int, number: int, requirement: str) -> None:
    """A delay of the suite's own computer makes the case inconclusive, not failed."""
    access = StallingAccess(Robot(ControllerCore, DEFAULT).network, opcode=opcode, number=number)
    options = Options(only=frozenset({requirement}), allowed=ALL)
    results = Run(ControllerAdapter(access, Ics(), PASSWORD, options)).results()
    messages = {case.message for case in results.cases if case.verdict is Verdict.INCONCLUSIVE}
    assert results.counts[Verdict.FAIL] == 0
    assert messages == {"this machine is too slow: the suite was silent for 31.000 s"}
