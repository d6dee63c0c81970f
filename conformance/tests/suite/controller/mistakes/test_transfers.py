"""Mistakes of other hands in transfers: a file arrives as it was sent, whatever else goes on.

Each is found by a case of a requirement that it violates.
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

Try = Callable[..., Any]

_CHUNK_BYTES = 212


class OldTimeOut(SendsAfterTheEnd):
    """The time-out of a transfer that has come to its end goes on, and ends the next one."""

    @cached_property
    def due_s(self) -> dict[int, float]:
        """When the last transfer of each connection would have been given up."""
        return {}

    def uploaded(self, session: Session, name: bytes) -> None:  # noqa: ARG002 - whatever it was
        """Forget to stop the timer."""
        self.due_s[session.connection] = self._handled_s + 30

    downloaded = uploaded

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Give up what is under way."""
        self._handled_s = now_s
        if now_s > self.due_s.get(session.connection, math.inf):
            del self.due_s[session.connection]
            self.abort_transfer(session)
        super().handle(session, frame, now_s)


class OneBuffer(ControllerCore):
    """What a program does is written where a chunk is made."""

    def emit(self, session: Session, frame: Frame) -> None:
        """Spoil it."""
        task = self.robot.task
        if frame.opcode == 0x56 and task is not None and task.program:
            frame = frame._replace(data=frame.data[:-1] + b"\1")
        super().emit(session, frame)


class GuardsTheBeginning(ControllerCore):
    """Of a transfer that has begun nobody measures the silence."""

    def _begun(self, request: Request) -> None:
        transfer = request.session.transfer
        if transfer is not None:
            transfer.end._timeout_s = None

    def upload_chunk(self, request: Request) -> bool | Silence:
        """Behind its second chunk that is an upload."""
        taken = super().upload_chunk(request)
        if request.value is not None and request.value.position:
            self._begun(request)
        return taken

    def download_chunk(self, request: Request) -> Silence:
        """Behind its first chunk that is a download."""
        silence = super().download_chunk(request)
        self._begun(request)
        return silence


class FindsWithoutExtension(ControllerCore):
    """A file is found without its extension, too."""

    def download_name(self, request: Request) -> bool:
        """Find it."""
        stems = {name.partition(b".")[0]: name for name in self.store.names()}
        name = stems.get(request.value, request.value)
        return super().download_name(replace(request, value=name))


class SilenceByTheClock(ControllerCore):
    """Takes the time of day for the time that passes: an upload ends when the clock is set."""

    def set_time(self, request: Request) -> bool:
        """Give up what has lasted for so long."""
        self.abort_transfer(request.session)
        was_set: bool = super().set_time(request)
        return was_set


class DeletesUploads(ControllerCore):
    """A deletion ends the uploads that are under way."""

    def delete_program(self, request: Request) -> bool:
        """End them."""
        for session in self.sessions.values():
            self.abort_transfer(session)
        return super().delete_program(request)


class LongFilesReachOver(SendsAfterTheEnd):
    """A file of more than 50,000 bytes is written over the beginning of the one before."""

    def uploaded(self, session: Session, name: bytes) -> None:  # noqa: ARG002 - whoever sends it
        """Spoil it."""
        before = max((other for other in self.store.names() if other < name), default=b"")
        if before and len(self.store.read(name)) > 50_000:
            content = self.store.read(before)
            self.remove(before)
            self.store.write(before, b"!" + content[1:])


class SixteenBits(ControllerCore):
    """Of a position two bytes count."""

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        """Take the others off."""
        if frame.opcode == 0x52 and len(frame.data) == _CHUNK_BYTES:
            frame = frame._replace(data=frame.data[:6] + bytes(2) + frame.data[8:])
        super().handle(session, frame, now_s)


class SignalsAndGoesOn(ControllerCore):
    """A download that was given up ends with a chunk of length 0, and goes on behind it."""

    @cached_property
    def given_up(self) -> set[int]:
        """The connections whose last download was."""
        return set()

    def _process_due(self, now_s: float) -> None:
        sending = [session for session in self.sessions.values() if session.transfer]
        super()._process_due(now_s)
        self.given_up.update(session.connection for session in sending if not session.transfer)

    def download_chunk(self, request: Request) -> Silence:
        """Send the next chunk behind the signal."""
        if request.session.connection in self.given_up:
            for length in (0, 200):
                self._send_chunk(request.session, Chunk(650, 200, length, bytes(length)))
        return super().download_chunk(request)


@pytest.mark.parametrize(
    ("core", "tries", "requirement"),
    [
        (SilenceByTheClock, "5.4/8", "5.4/8"),
        (DeletesUploads, "5.4/8", "5.4/8"),
        (LongFilesReachOver, "5.2/12", "5.2/12"),
        (OneBuffer, "5.2/12", "5.2/12"),
        (SixteenBits, "5.2/10", "5.2/10"),
        (OldTimeOut, "5.4/5", "5.4/5"),
        (OldTimeOut, "5.3/7", "5.3/7"),
        (SignalsAndGoesOn, "5.3/7", "5.3/7"),
        (FindsWithoutExtension, "5.3/3", "5.3/3"),
        (GuardsTheBeginning, "5.4/5", "5.4/5"),
        (GuardsTheBeginning, "5.3/7", "5.3/7"),
    ],
)
def test_it_is_found(tried: Try, core: type[ControllerCore], tries: str, requirement: str) -> None:
    """A case of what it tries fails, for what is violated."""
    assert requirement in tried(core, tries, examples=1).failed
