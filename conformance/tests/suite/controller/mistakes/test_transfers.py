"""Faulty controllers: file transfers and what happens at the same time.

For each fault, a case of the violated requirement must fail.
"""

import math
from collections.abc import Callable
from dataclasses import replace
from functools import cached_property
from typing import Any

import pytest

from scaraspec.mutants.operators.controller.transfers import SendsAfterTheEnd
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.transfer import Chunk
from scaraspec.virtual_controller.behaviour.base import Silence
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Request, Session

RunCases = Callable[..., Any]

_CHUNK_BYTES = 212


class KeepsOldTimeout(SendsAfterTheEnd):
    """The timeout of a completed transfer is not cancelled and aborts the next one."""

    @cached_property
    def due_s(self) -> dict[int, float]:
        """When the timeout of the last transfer expires, by connection."""
        return {}

    def uploaded(self, session: Session, name: bytes) -> None:  # noqa: ARG002 - unused
        self.due_s[session.connection] = self._handled_s + 30

    downloaded = uploaded

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        self._handled_s = now_s
        if now_s > self.due_s.get(session.connection, math.inf):
            del self.due_s[session.connection]
            self.abort_transfer(session)
        super().handle(session, frame, now_s)


class SharesBufferWithProgram(ControllerCore):
    """A running program overwrites the last byte of each sent chunk."""

    def emit(self, session: Session, frame: Frame) -> None:
        task = self.robot.task
        if frame.opcode == 0x56 and task is not None and task.program:
            frame = frame._replace(data=frame.data[:-1] + b"\1")
        super().emit(session, frame)


class TimesOutOnlyAtStart(ControllerCore):
    """The timeout applies only to the start of a transfer."""

    def _disable_timeout(self, request: Request) -> None:
        transfer = request.session.transfer
        if transfer is not None:
            transfer.end._timeout_s = None

    def upload_chunk(self, request: Request) -> bool | Silence:
        taken = super().upload_chunk(request)
        if request.value is not None and request.value.position:
            self._disable_timeout(request)
        return taken

    def download_chunk(self, request: Request) -> Silence:
        silence = super().download_chunk(request)
        self._disable_timeout(request)
        return silence


class FindsWithoutExtension(ControllerCore):
    """A file is also found without its extension."""

    def download_name(self, request: Request) -> bool:
        stems = {name.partition(b".")[0]: name for name in self.store.names()}
        name = stems.get(request.value, request.value)
        return super().download_name(replace(request, value=name))


class TimesOutBySetClock(ControllerCore):
    """The timeout uses the time of day: setting the clock aborts an upload."""

    def set_time(self, request: Request) -> bool:
        self.abort_transfer(request.session)
        was_set: bool = super().set_time(request)
        return was_set


class AbortsUploadsAtDeletion(ControllerCore):
    """A deletion aborts all open transfers."""

    def delete_program(self, request: Request) -> bool:
        for session in self.sessions.values():
            self.abort_transfer(session)
        return super().delete_program(request)


class LargeFileOverwritesPrevious(SendsAfterTheEnd):
    """A file of more than 50,000 bytes overwrites the beginning of the previous file."""

    def uploaded(self, session: Session, name: bytes) -> None:  # noqa: ARG002 - unused
        before = max((other for other in self.store.names() if other < name), default=b"")
        if before and len(self.store.read(name)) > 50_000:
            content = self.store.read(before)
            self.remove(before)
            self.store.write(before, b"!" + content[1:])


class SixteenBitPositions(ControllerCore):
    """Only the lower two bytes of a position are used."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        if frame.opcode == 0x52 and len(frame.data) == _CHUNK_BYTES:
            frame = frame._replace(data=frame.data[:6] + bytes(2) + frame.data[8:])
        super().handle(session, frame, now_s)


class ContinuesAfterErrorSignal(ControllerCore):
    """A download that timed out sends a chunk of length 0 and then the next chunk."""

    @cached_property
    def timed_out(self) -> set[int]:
        """The connections whose last download timed out."""
        return set()

    def _process_due(self, now_s: float) -> None:
        sending = [session for session in self.sessions.values() if session.transfer]
        super()._process_due(now_s)
        self.timed_out.update(session.connection for session in sending if not session.transfer)

    def download_chunk(self, request: Request) -> Silence:
        if request.session.connection in self.timed_out:
            for length in (0, 200):
                self._send_chunk(request.session, Chunk(650, 200, length, bytes(length)))
        return super().download_chunk(request)


@pytest.mark.parametrize(
    ("core", "only", "requirement"),
    [
        (TimesOutBySetClock, "5.4/8", "5.4/8"),
        (AbortsUploadsAtDeletion, "5.4/8", "5.4/8"),
        (LargeFileOverwritesPrevious, "5.2/16", "5.2/12"),
        (SharesBufferWithProgram, "5.2/12", "5.2/12"),
        (SixteenBitPositions, "5.2/10", "5.2/10"),
        (KeepsOldTimeout, "5.4/5", "5.4/5"),
        (KeepsOldTimeout, "5.3/7", "5.3/7"),
        (ContinuesAfterErrorSignal, "5.3/7", "5.3/7"),
        (FindsWithoutExtension, "5.3/3", "5.3/3"),
        (TimesOutOnlyAtStart, "5.4/5", "5.4/5"),
        (TimesOutOnlyAtStart, "5.3/7", "5.3/7"),
    ],
)
def test_fault_is_detected(
    run_cases: RunCases, core: type[ControllerCore], only: str, requirement: str
) -> None:
    """One of the cases that run fails for the violated requirement."""
    assert requirement in run_cases(core, only, examples=1, fail_fast=True).violated
