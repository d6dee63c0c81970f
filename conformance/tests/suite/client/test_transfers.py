"""Conforming clients that transfer files differently from the reference client pass clause 5."""

import asyncio
from contextlib import closing
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import Any

import pytest

from scaraspec.client import AsyncClient, ClientCore, TransferFailed
from scaraspec.client.driver import Driver
from scaraspec.client.operations import Text
from scaraspec.client.pending_operation import PendingOperation, Progress
from scaraspec.client.transfer import Upload
from scaraspec.judge.requirements import select
from scaraspec.judge.verdicts import Verdict
from scaraspec.mutants.client_run import MemoryClient
from scaraspec.mutants.operators.client.transfers import chunks_checked_by, chunks_cut_by
from scaraspec.protocol.commands import Parsed
from scaraspec.protocol.direction import A2C
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.readings import DEFAULT, Dialect
from scaraspec.protocol.transfer import FILE_DATA_BYTES, Chunk, Receiver, Sender, TransferState
from scaraspec.suite.client.harness.adapter import ClientAdapter
from scaraspec.suite.engine.ics import Ics
from scaraspec.suite.engine.plan import ALL, Options
from scaraspec.suite.engine.run import Run

ONLY = frozenset(r.id for r in select("5")) - {"5.2/16"}  # which is large
UPLOAD_CHUNK = 0x52


class Closes(AsyncClient):
    """Ends the connection after a failed transfer (A-5-26)."""

    async def perform(self, call: Any) -> Any:
        try:
            return await super().perform(call)
        except TransferFailed:
            await self.close()
            raise


class AutoResponder(AsyncClient):
    """Requests the status before each transfer and the program list after it."""

    async def upload(self, *where: Any, **more: Any) -> None:
        await self.get_status()
        await super().upload(*where, **more)
        await self.list_programs()

    async def download(self, *where: Any, **more: Any) -> Path:
        await self.get_status()
        path = await super().download(*where, **more)
        await self.list_programs()
        return path


class Verifies(AsyncClient):
    """Downloads an uploaded file and compares it (A-5-21)."""

    async def upload(self, local: Any, remote: Any = None, progress: Any = None) -> None:
        await super().upload(local, remote, progress)
        if await self.download_bytes(str(remote)) != _content(Path(local)):
            raise TransferFailed("upload", "it is another file there")


def _content(path: Path) -> bytes:
    return path.read_bytes()


class KeepsParts(AsyncClient):
    """Keeps an empty file after a failed download."""

    async def download(
        self,
        remote: Text,
        local: str | PathLike[str] | None = None,
        progress: Progress | None = None,
    ) -> Path:
        try:
            return await super().download(remote, local, progress)
        except TransferFailed:
            _make(Path(str(local)))
            raise


def _make(path: Path) -> None:
    path.touch(exist_ok=False)


class Retries(Upload):
    """Repeats a refused chunk twice (A-5-14), and then sends the abort signal."""

    left = 2

    @cached_property
    def sent(self) -> list[Frame]:
        return []

    def take(self, parsed: Parsed, data: bytes, now_s: float) -> list[Frame]:
        if data != b"1" and self.sent and self.left:
            self.left -= 1
            self._restart_timeout(now_s)
            return self.sent
        frames = super().take(parsed, data, now_s)
        self.sent[:] = frames
        return frames or self._signal()

    def expire(self, now_s: float) -> list[Frame]:
        return super().expire(now_s) or self._signal()

    def _signal(self) -> list[Frame]:
        """A frame without data (L787; A-5-10)."""
        return [Frame(A2C, UPLOAD_CHUNK)] if self.accepted and self.error else []


class RetriesCore(ClientCore):
    def upload(self, name: bytes, content: bytes) -> Upload:
        return Retries(name, content, self.dialect)


class Mute(ClientCore):
    """Does not answer chunks without a transfer."""

    def _refuse_stray_chunk(self, parsed: Parsed) -> None:
        pass


class OnlyFull(Receiver):
    """Rejects a chunk that is truncated after its content (A-5-3)."""

    def receive_chunk(self, data: bytes, now_s: float) -> bool | None:
        if data and len(data) != FILE_DATA_BYTES:
            self.fail("it is cut off")
            return False
        return super().receive_chunk(data, now_s)


class LittleOnly(Receiver):
    """Reads only little-endian numbers (A-5-2)."""

    def receive_chunk(self, data: bytes, now_s: float) -> bool | None:
        if int.from_bytes(data[8:12], "little") > FILE_DATA_BYTES:
            self.fail("its length is out of bounds")
            return False
        return super().receive_chunk(data, now_s)


class FailsOnOddAnswers(ClientCore):
    """Aborts a transfer when an answer to another command arrives."""

    def _dispatch(self, frame: Frame, now_s: float) -> Any:
        for operation in tuple(self._open):
            odd = frame.tagged or frame.opcode in (0x50, 0x52, 0x54)
            mine = not frame.tagged and frame.opcode == self._due(operation)
            if isinstance(operation, Upload) and odd and not mine:
                operation.fail(TransferFailed("upload", "another answer came"))
                return self._after_step(operation, now_s)
        return super()._dispatch(frame, now_s)

    def _due(self, operation: PendingOperation) -> int:
        return operation.command.opcode if operation.accepted is None else UPLOAD_CHUNK


class AnswersSignals(Receiver):
    """Answers the error signal with 0, like any invalid chunk (A-5-10)."""

    def receive_chunk(self, data: bytes, now_s: float) -> bool | None:
        active = self.state is TransferState.ACTIVE
        taken = super().receive_chunk(data, now_s)
        return False if active and taken is None else taken


class SmallChunks(Sender):
    """Sends chunks of 128 bytes."""

    def __init__(self, content: bytes, now_s: float, dialect: Dialect = DEFAULT) -> None:
        super().__init__(content, now_s, dialect)
        size = len(content)
        pieces = ((at, content[at : at + 128]) for at in range(0, size, 128))
        self._chunks = (Chunk(size, at, len(piece), piece) for at, piece in pieces)


class SmallAndMute(chunks_cut_by(SmallChunks), Mute):  # type: ignore[misc] # made by an operator
    """Does only what the document requires."""


class Particular(OnlyFull, LittleOnly):
    """Accepts one form of chunks only."""


class Touchy(FailsOnOddAnswers, chunks_checked_by(AnswersSignals)):  # type: ignore[misc] # made by an operator
    """Fails at every unexpected frame."""


class Sparing(AutoResponder):
    core = SmallAndMute


class Picky(KeepsParts):
    core = chunks_checked_by(Particular)


class Alert(AsyncClient):
    core = Touchy


class Stubborn(Closes):
    core = RetriesCore


class InTurn(Driver):
    """Runs one operation at a time."""

    @cached_property
    def turn(self) -> asyncio.Lock:
        return asyncio.Lock()

    async def _do(self, number: Any, name: str, values: dict[str, Any]) -> None:
        async with self.turn:
            await super()._do(number, name, values)


class OneAtATime(MemoryClient):
    def _new(self) -> Driver:
        def make(url: str, password: str | None) -> AsyncClient:
            return AsyncClient(url, password=password)

        return InTurn(self._take, make)


def _verdicts(access: MemoryClient, only: frozenset[str] = ONLY) -> dict[str, str]:
    options = Options(only=only, allowed=ALL, undefined=True, examples=3)
    with closing(access):
        results = Run(ClientAdapter(access, Ics(), options)).results()
    return {
        case.id: f"{case.verdict.value}: {case.message}"
        for case in results.cases
        if case.verdict is not Verdict.PASS
    }


@pytest.mark.parametrize(
    ("make", "tolerated"),
    [(Sparing, False), (Picky, True), (Alert, False), (Stubborn, True)],
    ids=lambda value: value.__name__ if isinstance(value, type) else "",
)
def test_no_false_alarm(make: type[AsyncClient], *, tolerated: bool) -> None:
    """No case fails. Tolerated readings are reported as tolerated."""
    verdicts = _verdicts(MemoryClient(make, DEFAULT))
    assert {v.partition(":")[0] for v in verdicts.values()} <= {"tolerated"}, verdicts
    assert bool(verdicts) is tolerated


def test_one_thing_at_a_time() -> None:
    """A driver with one operation at a time passes all cases that need only one."""
    verdicts = _verdicts(OneAtATime(AsyncClient, DEFAULT))
    assert set(verdicts) == {"5.2/9.meanwhile", "5.4/5.meanwhile"}
    assert all(verdict.startswith("none: ") for verdict in verdicts.values())


def test_verifies() -> None:
    """A client may download an uploaded file."""
    assert not _verdicts(MemoryClient(Verifies, DEFAULT), frozenset({"5.2/13", "5.2/18"}))


class Tidies(AsyncClient):
    """Deletes the rest of a failed upload and waits for the reply."""

    async def upload(self, local: Any, remote: Any = None, progress: Any = None) -> None:
        try:
            await super().upload(local, remote, progress)
        except TransferFailed:
            await self.delete_program(str(remote))
            raise


def test_the_report_shows_the_unanswered_request() -> None:
    """The report shows the unanswered request: the robot need not answer a deletion (A-5-12)."""
    dialect = DEFAULT.replace(xfer_timeout="1")
    options = Options(only=frozenset({"5.2/4"}), allowed=ALL, examples=3)
    with closing(MemoryClient(Tidies, dialect)) as access:
        results = Run(ClientAdapter(access, Ics(dialect=dialect), options)).results()
    (failed,) = (case for case in results.cases if case.verdict is Verdict.FAIL)
    assert failed.observed.startswith("silence; unanswered requests of the client: delete_program")
