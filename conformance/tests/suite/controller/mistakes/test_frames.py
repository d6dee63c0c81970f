"""Mistakes of other hands in frames: how they are cut out of what comes.

Each is found by a case of a requirement that it violates.
"""

from collections.abc import Callable
from typing import Any

import pytest

from scaraspec.mutants.operators.controller.connections import OtherFramer
from scaraspec.protocol.frames import Frame, StreamItem
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.request_framer import RequestFramer
from scaraspec.virtual_controller.session import Action

Try = Callable[..., Any]


class _Restarts(RequestFramer):
    """Takes a segment that begins with AA for a new frame."""

    def receive(self, data: bytes, now_s: float) -> list[StreamItem]:
        """Forget the old one."""
        if data.startswith(b"\xaa"):
            self._framer = self._new_framer()
        return super().receive(data, now_s)


class SegmentIsFrame(OtherFramer):
    """What begins with AA begins a frame, wherever that is."""

    framer = _Restarts


class _EndsAtAStop(RequestFramer):
    """Empties its buffer at an emergency stop."""

    def receive(self, data: bytes, now_s: float) -> list[StreamItem]:
        """Forget what is behind it."""
        found = super().receive(data, now_s)
        stops = (
            n for n, each in enumerate(found) if isinstance(each, Frame) and each.opcode == 0x32
        )
        return found[: next(stops, len(found)) + 1]


class StopsListening(OtherFramer):
    """What comes in one segment with an emergency stop, behind it, is lost."""

    framer = _EndsAtAStop


class _FullBuffer(RequestFramer):
    """Reads 256 bytes at once, and has no room for these behind what it has kept."""

    def receive(self, data: bytes, now_s: float) -> list[StreamItem]:
        """Forget the beginning of a frame where a whole buffer follows it."""
        found: list[StreamItem] = []
        for begin in range(0, len(data), 256):
            part = data[begin : begin + 256]
            if len(part) == 256:
                self._framer = self._new_framer()
            found += super().receive(part, now_s)
        return found


class FullBuffer(OtherFramer):
    """Where one buffer ends inside of a frame, and another is full, the frame is lost."""

    framer = _FullBuffer


class _FewPieces(RequestFramer):
    """Puts a frame together of eight pieces."""

    pieces = 0

    def receive(self, data: bytes, now_s: float) -> list[StreamItem]:
        """Give it up at the ninth."""
        self.pieces += 1
        if self.pieces > 8:
            self._framer, self.pieces = self._new_framer(), 0
        found = super().receive(data, now_s)
        if found:
            self.pieces = 0
        return found


class FewPieces(OtherFramer):
    """What comes in more than eight pieces is no frame."""

    framer = _FewPieces


class HalfAKilobyte(ControllerCore):
    """Of a segment of more than 512 bytes the rest is lost."""

    most_bytes = 512

    def receive(self, connection: int, data: bytes, now_s: float) -> list[Action]:
        """Cut it off."""
        return super().receive(connection, data[: self.most_bytes], now_s)


class Kilobyte(HalfAKilobyte):
    """Of one of more than 1024 bytes."""

    most_bytes = 1024


class EndsAtTheMark(ControllerCore):
    """A frame of a few bytes ends where its end byte stands first, and the next one begins."""

    def receive(self, connection: int, data: bytes, now_s: float) -> list[Action]:
        """Lose what it was."""
        length = data[2] if data[2:3] else 0
        if length < 12 and (found := data.find(0xCC, 3, 3 + length)) > 0:
            data = data[found + 1 :]
        return super().receive(connection, data, now_s)


class _OutputsLast(RequestFramer):
    """Settings of outputs wait until the rest of a segment has been served."""

    def receive(self, data: bytes, now_s: float) -> list[StreamItem]:
        """Put them behind it."""
        found = super().receive(data, now_s)
        return sorted(found, key=lambda each: isinstance(each, Frame) and each.opcode == 0x43)


class OutputsLast(OtherFramer):
    """The outputs have a task of their own, which comes later than that which answers."""

    framer = _OutputsLast


@pytest.mark.parametrize(
    ("core", "tries", "requirement"),
    [
        (OutputsLast, "3/30", "3/30"),
        (SegmentIsFrame, "2/5", "2/5"),
        (FewPieces, "2/5", "2/5"),
        (StopsListening, "4.17/2", "2/6"),
        (FullBuffer, "2/6", "2/6"),
        (HalfAKilobyte, "2/6", "2/6"),
        (Kilobyte, "2/6", "2/6"),
        (EndsAtTheMark, "3/9", "3/9"),
    ],
)
def test_it_is_found(tried: Try, core: type[ControllerCore], tries: str, requirement: str) -> None:
    """A case of what it tries fails, for what is violated."""
    assert requirement in tried(core, tries, examples=1).failed
