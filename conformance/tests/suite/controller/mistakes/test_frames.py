"""Faulty controllers: how they split the received bytes into frames.

For each fault, a case of the violated requirement must fail.
"""

from collections.abc import Callable
from typing import Any

import pytest

from scaraspec.mutants.controller import mutants
from scaraspec.mutants.operators.controller.connections import with_framer
from scaraspec.protocol.frames import Frame, StreamItem
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.request_framer import RequestFramer
from scaraspec.virtual_controller.session import Action

RunCases = Callable[..., Any]


class SegmentIsFrame(RequestFramer):
    """Discards an incomplete frame when a segment begins with 0xAA."""

    def receive(self, data: bytes, now_s: float) -> list[StreamItem]:
        if data.startswith(b"\xaa"):
            self._framer = self._new_framer()
        return super().receive(data, now_s)


class DropsSegmentAfterStop(RequestFramer):
    """Discards the rest of the segment after an emergency stop."""

    def receive(self, data: bytes, now_s: float) -> list[StreamItem]:
        items = super().receive(data, now_s)
        stops = (
            n for n, item in enumerate(items) if isinstance(item, Frame) and item.opcode == 0x32
        )
        return items[: next(stops, len(items)) + 1]


class DropsFrameBeforeFullBuffer(RequestFramer):
    """Discards an incomplete frame when the next 256 bytes arrive together."""

    def receive(self, data: bytes, now_s: float) -> list[StreamItem]:
        items: list[StreamItem] = []
        for begin in range(0, len(data), 256):
            part = data[begin : begin + 256]
            if len(part) == 256:
                self._framer = self._new_framer()
            items += super().receive(part, now_s)
        return items


class DropsFrameOfManySegments(RequestFramer):
    """Discards a frame that arrives in more than eight segments."""

    pieces = 0

    def receive(self, data: bytes, now_s: float) -> list[StreamItem]:
        self.pieces += 1
        if self.pieces > 8:
            self._framer, self.pieces = self._new_framer(), 0
        items = super().receive(data, now_s)
        if items:
            self.pieces = 0
        return items


class TruncatesTo512Bytes(ControllerCore):
    """Only the first 512 bytes of a segment are processed."""

    most_bytes = 512

    def receive(self, connection: int, data: bytes, now_s: float) -> list[Action]:
        return super().receive(connection, data[: self.most_bytes], now_s)


class TruncatesTo1024Bytes(TruncatesTo512Bytes):
    """Only the first 1024 bytes of a segment are processed."""

    most_bytes = 1024


class EndsAtFirstEndByte(ControllerCore):
    """A short frame ends at the first end byte in its data, and the next frame begins after it."""

    def receive(self, connection: int, data: bytes, now_s: float) -> list[Action]:
        length = data[2] if data[2:3] else 0
        if length < 12 and (end := data.find(0xCC, 3, 3 + length)) > 0:
            data = data[end + 1 :]
        return super().receive(connection, data, now_s)


class ExecutesOutputsLast(RequestFramer):
    """Executes settings of outputs after the other requests of a segment."""

    def receive(self, data: bytes, now_s: float) -> list[StreamItem]:
        items = super().receive(data, now_s)
        return sorted(items, key=lambda item: isinstance(item, Frame) and item.opcode == 0x43)


@pytest.mark.parametrize(
    ("core", "only", "requirement"),
    [
        (with_framer(ExecutesOutputsLast), "3/30", "3/30"),
        (with_framer(SegmentIsFrame), "2/5", "2/5"),
        (with_framer(DropsFrameOfManySegments), "2/5", "2/5"),
        (with_framer(DropsSegmentAfterStop), "4.17/2", "2/6"),
        (with_framer(DropsFrameBeforeFullBuffer), "2/6", "2/6"),
        (TruncatesTo512Bytes, "2/6", "2/6"),
        (TruncatesTo1024Bytes, "2/6", "2/6"),
        (EndsAtFirstEndByte, "3/9", "3/9"),
    ],
)
def test_fault_is_detected(
    run_cases: RunCases, core: type[ControllerCore], only: str, requirement: str
) -> None:
    """One of the cases that run fails for the violated requirement."""
    assert requirement in run_cases(core, only, examples=1, fail_fast=True).violated


def test_wrong_length_of_the_first_reply(run_cases: RunCases) -> None:
    """A login reply with a wrong length is proved by the next reply, and is not called missing."""
    ran = run_cases(mutants()["counts-end-byte-of-login"].wrong, "3/7", examples=1)
    assert "3/7" in ran.violated
    assert "login was not answered completely" in ran["3/1"].message
