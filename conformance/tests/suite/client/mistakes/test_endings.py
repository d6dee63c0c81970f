"""Mistakes of clients about the end of an operation: without a reply it has not succeeded."""

import asyncio
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

from scaraspec.client import AsyncClient, ClientCore, ClientError, LinkLost
from scaraspec.client.core import Event
from scaraspec.client.pending_operation import PendingOperation, Stage, TwoStage
from scaraspec.client.transfer import Upload
from scaraspec.judge.verdicts import Verdict
from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.direction import C2A
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.readings import DEFAULT
from scaraspec.protocol.transfer import BUFFER_BYTES

_IDLE = Frame(C2A, BY_NAME["get_status"].opcode, b"00").encode()
_REFUSED_THEN_SENT = "5.2/19.download-refused-then-sent"

Try = Callable[..., Mapping[str, Verdict]]


class WaitsOnForLostAnswers(ClientCore):
    """Still waits for the reply to an aborted transfer and takes the next reply for it."""

    outstanding = False

    class _Outstanding(Upload):
        core: "WaitsOnForLostAnswers"

        def _fail_transfer(self, reason: str) -> None:
            self.core.outstanding = True
            super()._fail_transfer(reason)

    def upload(self, name: bytes, content: bytes) -> Upload:
        upload = self._Outstanding(name, content, DEFAULT)
        upload.core = self
        return upload

    def _dispatch(self, frame: Frame, now_s: float) -> list[Event]:
        if self.outstanding and frame.opcode == BY_NAME["upload_chunk"].opcode:
            self.outstanding = False
            return []
        return super()._dispatch(frame, now_s)


def test_a_late_reply_of_an_aborted_transfer(tried: Try) -> None:
    """After a timeout, a new reply belongs to the next transfer."""
    assert tried(WaitsOnForLostAnswers, "5.2/9.meanwhile")["5.2/9.meanwhile"] is Verdict.FAIL


class NeedsNoLastAnswer(ClientCore):
    """Reports an upload as done after its last chunk, without an answer."""

    class _Sent(Upload):
        def expire(self, now_s: float) -> list[Frame]:
            if self.accepted and self.moved_bytes + BUFFER_BYTES >= len(self._content):
                self.settle(None)
                return []
            return super().expire(now_s)

    def upload(self, name: bytes, content: bytes) -> Upload:
        return self._Sent(name, content, DEFAULT)


class DoneWhenIdle(ClientCore):
    """Reports an executing command as done when the status is idle."""

    def feed(self, data: bytes, now_s: float) -> list[Event]:
        events = super().feed(data, now_s)
        for operation in self._executing() if _IDLE in data else ():
            operation.settle(None)
            events += self._after_step(operation, now_s)
        return events


class AsksUntilIdle(AsyncClient):
    """Polls the status while a program runs and reports it as done when the robot is idle."""

    async def run_program(self, name: Any) -> None:
        run = await self.start_run_program(name)
        while not run.done:
            await asyncio.sleep(0.5)
            if not run.done and (await self.get_status()).code == "00":
                return
        await run.wait()


class DoneWhenLost(ClientCore):
    """Reports an executing command as done when the link is lost."""

    def connection_lost(self, reason: str, now_s: float) -> list[Event]:
        events = []
        for operation in self._executing():
            operation.settle(None)
            events += self._after_step(operation, now_s)
        return events + super().connection_lost(reason, now_s)


@pytest.mark.parametrize(
    ("make", "case"),
    [
        (NeedsNoLastAnswer, "5.2/9.meanwhile"),
        (DoneWhenIdle, "4/16.while-idle"),
        (AsksUntilIdle, "4/16.while-idle"),
        (DoneWhenLost, "4/16.reconnected"),
    ],
)
def test_an_unanswered_operation_has_not_succeeded(
    tried: Try, make: type[ClientCore] | type[AsyncClient], case: str
) -> None:
    """Silence, an idle robot or a lost link does not show how a command ended."""
    assert tried(make, case.rpartition(".")[0])[case] is Verdict.FAIL


class TakesLossForYes(ClientCore):
    """Reports a setting as done when the connection ends."""

    class _Sent(PendingOperation):
        def fail(self, error: ClientError) -> None:
            if isinstance(error, LinkLost):
                self.settle(None)
            else:
                super().fail(error)

    def command(self, name: str, value: Any = None) -> PendingOperation:
        if name != "set_time":
            return super().command(name, value)
        return self._Sent(BY_NAME[name], value, self.dialect)


class TakesLossForStopped(ClientCore):
    """Reports an executing stop as done when the connection ends."""

    class _Sent(TwoStage):
        def fail(self, error: ClientError) -> None:
            if isinstance(error, LinkLost) and self.stage is Stage.EXECUTING:
                self.settle(None)
            else:
                super().fail(error)

    def command(self, name: str, value: Any = None) -> PendingOperation:
        if name != "emergency_stop":
            return super().command(name, value)
        return self._Sent(BY_NAME[name], value, self.dialect)


class WritesNowhere(AsyncClient):
    """Reports a download as successful although the file cannot be written."""

    async def download(self, remote: Any, *where: Any) -> Path:
        with suppress(OSError):
            return await super().download(remote, *where)
        return Path()


@pytest.mark.parametrize(
    ("make", "case"),
    [
        (TakesLossForYes, "3/33.flag"),
        (TakesLossForStopped, "4/16.reconnected"),
        (WritesNowhere, _REFUSED_THEN_SENT),
    ],
)
def test_a_missing_reply_is_not_a_success(
    tried: Try, make: type[ClientCore] | type[AsyncClient], case: str
) -> None:
    """A missing reply or a missing file is not a success."""
    assert tried(make, case)[case] is Verdict.FAIL
