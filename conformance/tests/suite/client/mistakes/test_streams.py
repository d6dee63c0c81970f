"""Mistakes of clients with the byte stream: split frames, frames within data, joined frames."""

import math
from collections.abc import Callable, Mapping

import pytest

from scaraspec.client import ClientCore
from scaraspec.client.core import Event
from scaraspec.judge.verdicts import Verdict
from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.direction import C2A
from scaraspec.protocol.frames import Frame, Framer
from scaraspec.protocol.readings import Dialect

Try = Callable[..., Mapping[str, Verdict]]


class HoldsThreeHundredBytes(ClientCore):
    """Loses bytes that exceed its buffer."""

    def feed(self, data: bytes, now_s: float) -> list[Event]:
        return super().feed(data[:300], now_s)


class LooksForFramesInData(ClientCore):
    """Searches for the next frame inside an incomplete frame."""

    def feed(self, data: bytes, now_s: float) -> list[Event]:
        events = super().feed(data, now_s)
        held = data[len(data) - self._framer.buffered_bytes :]
        _, mark, after = held.partition(b"\xaa\xcc")
        if mark:
            self._framer = Framer(C2A)
            events += super().feed(mark[1:] + after, now_s)
        return events


class ListsEndAtOtherFrames(ClientCore):
    """Ends a list when any other frame arrives."""

    coming = False

    def _dispatch(self, frame: Frame, now_s: float) -> list[Event]:
        of_list = frame.opcode == BY_NAME["list_programs"].opcode
        if of_list:
            self.coming = frame.data.startswith(b"1")
        elif self.coming:
            return self._dispatch(Frame(C2A, BY_NAME["list_programs"].opcode, b"0"), now_s)
        return super()._dispatch(frame, now_s)


class KeepsHalves(ClientCore):
    """Continues a partial frame with the bytes of the next connection."""

    kept = Framer(C2A)

    def __init__(self, dialect: Dialect) -> None:
        super().__init__(dialect)
        self._framer, self._last_received_s = self.kept, math.inf  # nothing was received yet

    def connection_lost(self, reason: str, now_s: float) -> list[Event]:
        self._framer = Framer(C2A)
        return super().connection_lost(reason, now_s)


def test_a_partial_frame_ends_with_its_connection(tried: Try) -> None:
    """The reply to the next login is not the rest of an earlier frame."""
    assert tried(KeepsHalves, "3/29")["3/29"] is Verdict.FAIL


@pytest.mark.parametrize(
    ("core", "case"),
    [
        (HoldsThreeHundredBytes, "2/6.list"),
        (LooksForFramesInData, "3/9"),
        (ListsEndAtOtherFrames, "4.10/10.late"),
    ],
)
def test_all_forms_of_a_stream_are_tested(tried: Try, core: type[ClientCore], case: str) -> None:
    """Joined frames, frames that contain frames, and results at any time occur in the cases."""
    only, _, _ = case.partition(".l")
    assert tried(core, only)[case] is Verdict.FAIL


class WaitsATurnLater(ClientCore):
    """Accepts a final result only after a turn of the event loop after the first reply."""

    accepted_s = -math.inf

    def _dispatch(self, frame: Frame, now_s: float) -> list[Event]:
        if frame.tagged and now_s == self.accepted_s:
            return []
        if frame.data == b"1":
            self.accepted_s = now_s
        return super()._dispatch(frame, now_s)


def test_lost_joined_results_fail_one_requirement(tried: Try) -> None:
    """One mistake with joined results does not fail every two-stage command."""
    cases = tried(WaitsATurnLater, "4/10", "3/13", "4.15/1", "4.17/1", "4.24/1")
    failed = {case for case, verdict in cases.items() if verdict is Verdict.FAIL}
    assert "4/10" in failed
    assert {case.partition(".")[0] for case in failed} == {"4/10"}
