"""Conforming controllers that transfer files according to readings of their own.

The register lists these readings or leaves them open. No case and no rule of the judge may fail.
"""

import itertools
import math
from collections.abc import Callable
from typing import Any

import pytest

from scaraspec.judge.requirements import REQUIREMENTS
from scaraspec.judge.verdicts import Verdict
from scaraspec.mutants import controller_run
from scaraspec.protocol.direction import C2A
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.hazard import Hazard
from scaraspec.protocol.payloads import Acceptance
from scaraspec.protocol.readings import DEFAULT, Dialect
from scaraspec.protocol.transfer import FILE_DATA, Chunk, Receiver, Sender, TransferState
from scaraspec.virtual_controller.behaviour import SILENCE
from scaraspec.virtual_controller.behaviour.base import Silence, refused
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.plant import Plant
from scaraspec.virtual_controller.session import Action, Carrier, OpenTransfer, Request, Session
from scaraspec.virtual_controller.store import Store

RunCases = Callable[..., Any]

_POLL_S = 0.01
_SHORT_TIMEOUT: dict[str, Any] = {
    "dialect": DEFAULT.replace(xfer_timeout="1"),
    "claimed": {"xfer_timeout"},
}


class RefusesUnexpectedAnswers(ControllerCore):
    """An answer to a chunk is answered 0 if no chunk was sent or the download is over."""

    def download_chunk(self, request: Request) -> Silence:
        transfer = request.session.transfer
        if transfer is None or not isinstance(transfer.end, Sender):
            self.emit(request.session, Frame(C2A, request.frame.opcode, b"0"))
            return SILENCE
        return super().download_chunk(request)


class IgnoresStrayChunks(ControllerCore):
    """A chunk without an upload is not answered (A-5-16)."""

    def upload_chunk(self, request: Request) -> bool | Silence:
        return super().upload_chunk(request) if request.session.transfer else SILENCE


def test_a_late_chunk_may_be_ignored(run_cases: RunCases) -> None:
    """Waiting for a reply to a late chunk does not make another upload time out."""
    assert not run_cases(IgnoresStrayChunks, "5.4/5", **_SHORT_TIMEOUT).problems


def test_chunk_on_another_connection_may_be_ignored(run_cases: RunCases) -> None:
    """Waiting for a reply on another connection does not make the upload time out."""
    assert not run_cases(IgnoresStrayChunks, "5.2/11", **_SHORT_TIMEOUT).problems


class ClosesAfterFailedTransfer(ControllerCore):
    """A chunk out of bounds, or a refused chunk of a download, closes the connection."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        end = session.transfer.end if session.transfer else None
        chunk = FILE_DATA.decode(frame.data).value if frame.opcode == 0x52 else None
        if isinstance(end, Receiver) and isinstance(chunk, Chunk) and not chunk.legal:
            self._end(session, now_s)
            return
        super().handle(session, frame, now_s)
        if isinstance(end, Sender) and end.state is TransferState.FAILED:
            self._end(session, now_s)


def test_failed_transfer_may_close_the_connection(run_cases: RunCases) -> None:
    """The cases continue on a new connection (A-5-26)."""
    only = ("5.2/6", "5.3/9", "5.4/6", "5.4/8")
    assert not run_cases(ClosesAfterFailedTransfer, *only).problems


class SmallStore(ControllerCore):
    """There is room for eight files and for 20,000 bytes in total."""

    def __init__(self, plant: Plant, store: Store, *others: Any) -> None:
        super().__init__(plant, store, *others)
        self.store = Store(max_bytes=20_000, max_files=8)


def test_store_may_be_small(run_cases: RunCases) -> None:
    """The number and the size of files are open (A-5-21, A-5-25)."""
    only = ("3/6", "4.9/3", "5.1/7", "5.2/10", "5.2/16", "5.4/2")
    assert not run_cases(SmallStore, *only).problems


@pytest.mark.parametrize("partial_keep", ["remove", "keep"])
def test_store_may_be_small_for_many_examples(run_cases: RunCases, partial_keep: str) -> None:
    """The files of one example, complete or interrupted, are deleted before the next one."""
    actual = DEFAULT.replace(partial_keep=partial_keep)
    only = ("5.1/8", "5.1/12", "5.2/10", "5.4/4", "5.4/5")
    assert not run_cases(SmallStore, *only, actual=actual, examples=10).problems


def with_places(count: int, of_user: int) -> type[ControllerCore]:
    """Return a controller with this many places for files, some of them taken by the user."""

    class FewPlaces(ControllerCore):
        def __init__(self, plant: Plant, store: Store, *others: Any) -> None:
            super().__init__(plant, store, *others)
            self.store = Store(max_files=count)
            for number in range(of_user):
                self.store.write(b"weld%d.rob" % number, b"x")

    return FewPlaces


_PLACES = ("4.10/4", "5.1/7", "5.2/2", "5.4/1", "5.4/2", "5.4/6")


@pytest.mark.parametrize("of_user", [0, 3, 4])
def test_store_may_have_five_places(run_cases: RunCases, of_user: int) -> None:
    """Cases that need more places are skipped and name the reason (A-5-21)."""
    cases = run_cases(with_places(5, of_user), *_PLACES)
    assert not cases.problems
    skipped = [case.message for case in cases.values() if case.verdict is Verdict.NONE]
    assert set(skipped) == {"the store is full: it has no place for another file"}
    assert cases["5.2/2"].verdict is Verdict.PASS


def test_programs_of_the_user_may_fill_the_store(run_cases: RunCases) -> None:
    """No verdict is possible, and the message states what to do."""
    cases = run_cases(with_places(5, 5), "5.4/1")
    assert not cases.violated
    assert "delete programs" in cases["5.4/1"].message
    assert "5.2/2" in run_cases(with_places(0, 0), "5.2/2").violated


class TakesPlainNames(ControllerCore):
    """Only letters, digits and one dot are accepted in a name."""

    def upload_name(self, request: Request) -> bool:
        stem, _, extension = request.value.partition(b".")
        plain: bool = stem.isalnum() and extension.isalpha()
        return plain and super().upload_name(request)


def test_characters_of_names_may_be_limited(run_cases: RunCases) -> None:
    """The characters of names are open (A-5-20)."""
    assert not run_cases(TakesPlainNames, "5.2/2", "5.2/11", "5.2/12").problems


class WritesSlowly(ControllerCore):
    """A chunk is answered when it is written, which takes some time."""

    write_s = 6.0

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self._written: list[tuple[float, Session]] = []

    def upload_chunk(self, request: Request) -> bool | Silence:
        reply = super().upload_chunk(request)
        if reply is not True:
            return reply
        self._written.append((request.now_s + self.write_s, request.session))
        return SILENCE

    def _process_due(self, now_s: float) -> None:
        super()._process_due(now_s)
        while self._written and self._written[0][0] <= now_s:
            self.emit(self._written.pop(0)[1], Frame(C2A, 0x52, b"1"))

    @property
    def next_event_s(self) -> float | None:
        times_s = [super().next_event_s, *(at_s for at_s, _ in self._written)]
        return min((at_s for at_s in times_s if at_s is not None), default=None)


def test_reply_to_a_chunk_may_be_slow(run_cases: RunCases) -> None:
    """The suite waits for the reply to a chunk as long as the document allows (L763)."""
    assert not run_cases(WritesSlowly, "5.2/6", "5.1/8").problems


def test_chunks_are_waited_for_as_claimed(run_cases: RunCases) -> None:
    """The limit is the transfer timeout that the subject claims."""
    core = type("Slow", (WritesSlowly,), {"write_s": 40.0})
    assert not run_cases(core, "5.2/6", dialect=DEFAULT.replace(xfer_timeout="60")).problems


def test_late_subject_is_named(run_cases: RunCases) -> None:
    """If the silence of the suite is a wait for the subject, the message says so."""
    core = type("Slow", (WritesSlowly,), {"write_s": 3.0})
    cases = run_cases(core, "5.2/6", dialect=DEFAULT.replace(xfer_timeout="1"))
    assert "the subject or the network is too slow" in cases["5.2/6"].message


class PollsConnections(ControllerCore):
    """Answers to chunks are processed 10 ms later, or with the next request of the client."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self._waiting: list[tuple[float, Session, Frame]] = []

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        self._process_waiting(now_s, client=session)
        if frame.opcode == 0x56:
            self._waiting.append((now_s, session, frame))
        else:
            super().handle(session, frame, now_s)

    def _process_waiting(self, now_s: float, client: Session | None = None) -> None:
        waiting, self._waiting = self._waiting, []
        for received_s, session, frame in waiting:
            if session is client or now_s >= received_s + _POLL_S:
                super().handle(session, frame, now_s)
            else:
                self._waiting.append((received_s, session, frame))

    def _process_due(self, now_s: float) -> None:
        super()._process_due(now_s)
        self._process_waiting(now_s)

    @property
    def next_event_s(self) -> float | None:
        times_s = [
            super().next_event_s,
            *(received_s + _POLL_S for received_s, *_ in self._waiting),
        ]
        return min((at_s for at_s in times_s if at_s is not None), default=None)


def test_download_may_end_at_the_next_poll(run_cases: RunCases) -> None:
    """Until the poll, another client's deletion of the file is refused (A-4.11-1)."""
    only = ("3/31", "5.2/12", "4.11/2")
    assert not run_cases(PollsConnections, *only, examples=20).problems


class OneTransferAtATime(PollsConnections):
    """While one client transfers a file, transfers of other clients are refused (A-5-17)."""

    def _can_begin(self, session: Session) -> bool:
        others = (other for other in self.sessions.values() if other is not session)
        return super()._can_begin(session) and not any(other.transfer for other in others)


def test_one_transfer_at_a_time(run_cases: RunCases) -> None:
    """The suite starts another download only when the controller has finished the previous one."""
    only = ("3/31", "4.2/4", "5.2/12", "5.4/1")
    assert not run_cases(OneTransferAtATime, *only, examples=20).problems


class TransferOutlivesConnection(ControllerCore):
    """There is one transfer at a time. It ends with its timeout, not with its connection."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.orphaned: list[OpenTransfer] = []

    def _remove_session(self, session: Session, now_s: float) -> None:
        if session.transfer:
            self.orphaned.append(session.transfer)
        super()._remove_session(session, now_s)

    def _process_due(self, now_s: float) -> None:
        super()._process_due(now_s)
        for transfer in self.orphaned:
            transfer.end.expire(now_s)

    def _can_begin(self, session: Session) -> bool:
        others = (other.transfer for other in self.sessions.values() if other is not session)
        return super()._can_begin(session) and not any((*others, *self.open_transfers))

    @property
    def open_transfers(self) -> list[OpenTransfer]:
        """The transfers of closed connections that have not ended."""
        return [
            transfer for transfer in self.orphaned if transfer.end.state is TransferState.ACTIVE
        ]


class TransferNeverEnds(TransferOutlivesConnection):
    """The transfer of a closed connection never ends."""

    @property
    def open_transfers(self) -> list[OpenTransfer]:
        return self.orphaned


def test_a_transfer_may_outlive_its_connection(run_cases: RunCases) -> None:
    """Other uploads are refused until the timeout of the transfer (A-5-17)."""
    only = ("4.15/5", "5.1/9", "5.2/2", "5.2/11", "5.3/7", "5.4/5", "5.4/7")
    cases = run_cases(TransferOutlivesConnection, *only)
    assert not cases.problems
    assert cases["5.4/7.closed"].verdict is Verdict.TOLERATED
    assert "5.2/2" in run_cases(TransferNeverEnds, *only).violated


class KeepsPartialUpload(ControllerCore):
    """An interrupted upload leaves the blocks of 150 bytes that were already written (A-5-12)."""

    def abort_transfer(self, session: Session) -> None:
        transfer = session.transfer
        super().abort_transfer(session)
        if transfer is not None and isinstance(transfer.end, Receiver):
            content = transfer.end.content
            self._write(transfer.name, self.partial_content(content[: len(content) // 150 * 150]))

    def partial_content(self, written: bytes) -> bytes:
        """Return the content of the file that is left over."""
        return written


class DamagesPartialUpload(KeepsPartialUpload):
    """An interrupted upload leaves a file with another content."""

    def partial_content(self, written: bytes) -> bytes:
        return written[1:]


def test_beginning_of_an_interrupted_upload_may_stay(run_cases: RunCases) -> None:
    """The written part may stay, or an empty file if empty files can be downloaded."""
    readings = {
        "dialect": _SHORT_TIMEOUT["dialect"].replace(empty_file="chunk"),
        "claimed": {"xfer_timeout"},
    }
    cases = run_cases(KeepsPartialUpload, "5.4/5", "5.4/7", **readings)
    assert not cases.problems
    assert cases["5.4/7.closed"].verdict is Verdict.TOLERATED
    assert "5.4/7" in run_cases(DamagesPartialUpload, "5.4/7", **readings).violated


class SendsStatusPeriodically(ControllerCore):
    """The status is sent ten times a second without a request (A-3-16)."""

    _every_s = 0.1
    _due_s = math.inf

    def open(self, connection: int, now_s: float, link: Carrier = "tcp") -> list[Action]:
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
        return min(super().next_event_s or math.inf, self._due_s)


def test_unsolicited_frames_are_not_replies(run_cases: RunCases) -> None:
    """An unsolicited status is neither a chunk (5.3/6) nor a reply to any request."""
    assert not run_cases(
        SendsStatusPeriodically, "2/12", "3/21", "5.3/7", **_SHORT_TIMEOUT, examples=1
    ).problems


class BusyInTransfers(ControllerCore):
    """During a file transfer the status of an idle robot is 01, and moves are refused as busy."""

    @property
    def _transfers(self) -> bool:
        return any(session.transfer for session in self.sessions.values())

    def get_status(self, request: Request) -> str:
        status = super().get_status(request)
        return "01" if status == "00" and self._transfers else status

    def set_tool_coordinates(self, request: Request) -> Acceptance:
        busy = self.robot.task is None and self._transfers
        return refused("01") if busy else super().set_tool_coordinates(request)


def test_robot_may_be_busy_in_transfers(run_cases: RunCases) -> None:
    """The status is reported as tolerated (A-5-17), and the emergency stop works."""
    cases = run_cases(BusyInTransfers, "4/2", "4.17/6", "5.4/8")
    assert not cases.problems
    names = ("5.4/8.upload", "5.4/8.download", "5.4/8.elsewhere", "4/7.seen-1")
    assert {cases[name].verdict for name in names} == {Verdict.TOLERATED}


class BusyAfterTransfers(BusyInTransfers):
    """The status stays 01 after the first file transfer."""

    _transferred = False

    @property
    def _transfers(self) -> bool:
        self._transferred = self._transferred or super()._transfers
        return self._transferred


def test_robot_must_be_idle_after_transfers(run_cases: RunCases) -> None:
    """After a transfer the status must be 00 again."""
    cases = run_cases(BusyAfterTransfers, "5.4/8", allowed=(Hazard.READ_ONLY, Hazard.STATE))
    assert "4.8/3" in cases.violated


class IgnoresErrorSignal(ControllerCore):
    """A chunk of length 0 does not end an upload (A-5-10)."""

    reply: bool | Silence = SILENCE

    def upload_chunk(self, request: Request) -> bool | Silence:
        chunk = FILE_DATA.decode(request.frame.data).value
        ends = isinstance(chunk, Chunk) and chunk.length > 0
        return super().upload_chunk(request) if ends else self.reply


@pytest.mark.parametrize("reply", [SILENCE, False, True])
def test_upload_may_continue_after_the_error_signal(run_cases: RunCases, reply: object) -> None:
    """An upload that continues is reported as tolerated."""
    core = type("Ignores", (IgnoresErrorSignal,), {"reply": reply})
    cases = run_cases(core, "5.4/6")
    assert not cases.problems
    assert cases["5.4/6.error-signal"].verdict is Verdict.TOLERATED


class SignalsFailedDownload(ControllerCore):
    """A failed download ends with a chunk of length 0."""

    def _process_due(self, now_s: float) -> None:
        transfers = [(session, session.transfer) for session in self.sessions.values()]
        super()._process_due(now_s)
        for session, transfer in transfers:
            if transfer is not None and session.transfer is None:
                self._signal(session, transfer.end)

    def download_chunk(self, request: Request) -> Silence:
        transfer = request.session.transfer
        reply = super().download_chunk(request)
        if transfer is not None:
            self._signal(request.session, transfer.end)
        return reply

    def _signal(self, session: Session, end: Sender | Receiver) -> None:
        if isinstance(end, Sender) and end.state is TransferState.FAILED:
            signal = FILE_DATA.encode(Chunk(end.size_bytes, 0, 0, b""), self.dialect)
            self.emit(session, Frame(C2A, 0x56, signal))


def test_download_may_end_with_the_error_signal(run_cases: RunCases) -> None:
    """A chunk of length 0 is the error signal (L787), not a further chunk of the file."""
    assert not run_cases(
        SignalsFailedDownload, "5.3/6", "5.3/7", "5.3/9", "5.4/6", **_SHORT_TIMEOUT
    ).problems


class IgnoresLetterCase(ControllerCore):
    """A name that differs only in case from that of a stored file is refused (A-5-20)."""

    def upload_name(self, request: Request) -> bool:
        stored = {name.lower() for name in self.store.names()}
        return request.value.lower() not in stored and super().upload_name(request)


def test_letter_case_may_be_ignored(run_cases: RunCases) -> None:
    """A second name in another case may count as taken."""
    cases = run_cases(IgnoresLetterCase, "5.2/12")
    assert cases["5.2/12.letter-case"].verdict is Verdict.TOLERATED
    assert not cases.problems


class AnswersTheErrorSignal(ControllerCore):
    """A chunk of length 0 aborts an upload and is answered 0 (A-5-10)."""

    def upload_chunk(self, request: Request) -> bool | Silence:
        reply = super().upload_chunk(request)
        return False if reply is SILENCE else reply


def test_the_error_signal_may_be_answered(run_cases: RunCases) -> None:
    """The reply is not treated as the reply to the first chunk of another file."""
    assert not run_cases(
        AnswersTheErrorSignal, "5.2/14", "5.2/17", "5.4/6", **_SHORT_TIMEOUT
    ).problems


def test_unexpected_answer_may_be_refused(run_cases: RunCases) -> None:
    """The reply 0 is not a chunk (A-5-16), neither for the cases nor for the judge."""
    assert not run_cases(RefusesUnexpectedAnswers, "5.3/10").problems


@pytest.mark.parametrize("chunks", [1, 2, 3, 4])
def test_stored_program_may_be_short(run_cases: RunCases, chunks: int) -> None:
    """If nothing may be uploaded, a program of the robot is downloaded, whatever its size is."""

    class Delivered(ControllerCore):
        def __init__(self, plant: Plant, store: Store, dialect: Dialect) -> None:
            if b"demo.rob" not in store:
                store.write(b"demo.rob", bytes(200 * chunks - 25))
            super().__init__(plant, store, dialect)

    only = (r for r in REQUIREMENTS if r.startswith(("5.1/", "5.3/")))
    cases = run_cases(Delivered, *only, allowed=(Hazard.READ_ONLY,), examples=1)
    assert not cases.problems


def test_any_names_of_the_run(run_cases: RunCases, monkeypatch: pytest.MonkeyPatch) -> None:
    """The names of the run's files have random letters; exchanging two may change nothing."""
    monkeypatch.setattr(controller_run, "tokens", lambda: itertools.repeat("sa"))
    assert not run_cases(ControllerCore, "4.11/4", "5.3/3").problems
