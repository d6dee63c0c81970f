"""Mistakes of clients in what comes as a stream: frames in pieces, within data, behind an end."""

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
    """What comes at once and is more than its buffer holds is lost."""

    def feed(self, data: bytes, now_s: float) -> list[Event]:
        return super().feed(data[:300], now_s)


class LooksForFramesInData(ClientCore):
    """While a frame is not whole it goes on where a frame seems to end and another to begin."""

    def feed(self, data: bytes, now_s: float) -> list[Event]:
        events = super().feed(data, now_s)
        held = data[len(data) - self._framer.held_bytes :]
        _, mark, behind = held.partition(b"\xaa\xcc")
        if mark:
            self._framer = Framer(C2A)
            events += super().feed(mark[1:] + behind, now_s)
        return events


class ListsEndAtOtherFrames(ClientCore):
    """Any other frame ends a list that is coming."""

    coming = False

    def _dispatch(self, frame: Frame, now_s: float) -> list[Event]:
        of_list = frame.opcode == BY_NAME["list_programs"].opcode
        if of_list:
            self.coming = frame.data.startswith(b"1")
        elif self.coming:
            return self._dispatch(Frame(C2A, BY_NAME["list_programs"].opcode, b"0"), now_s)
        return super()._dispatch(frame, now_s)


class KeepsHalves(ClientCore):
    """What had come of a frame when its connection ended begins what comes on the next one."""

    kept = Framer(C2A)

    def __init__(self, dialect: Dialect) -> None:
        super().__init__(dialect)
        self._framer, self._last_received_s = self.kept, math.inf  # nothing was heard yet

    def connection_lost(self, reason: str, now_s: float) -> list[Event]:
        self._framer = Framer(C2A)
        return super().connection_lost(reason, now_s)


def test_half_a_frame_ends_with_its_connection(tried: Try) -> None:
    """A reply to the next login is not taken for the rest of it."""
    assert tried(KeepsHalves, "3/29")["3/29"] is Verdict.FAIL


@pytest.mark.parametrize(
    ("core", "case"),
    [
        (HoldsThreeHundredBytes, "2/6.list"),
        (LooksForFramesInData, "3/9"),
        (ListsEndAtOtherFrames, "4.10/10.late"),
    ],
)
def test_what_a_stream_may_bring_is_brought(tried: Try, core: type[ClientCore], case: str) -> None:
    """Full frames come at once, half a frame's data looks like frames, results come anywhere."""
    only, _, _ = case.partition(".l")
    assert tried(core, only)[case] is Verdict.FAIL


class WaitsATurnLater(ClientCore):
    """A final result is awaited from the turn of its loop on that follows the first reply."""

    accepted_s = -math.inf

    def _dispatch(self, frame: Frame, now_s: float) -> list[Event]:
        if frame.tagged and now_s == self.accepted_s:
            return []
        if frame.data == b"1":
            self.accepted_s = now_s
        return super()._dispatch(frame, now_s)


def test_what_comes_at_once_is_lost_where_that_is_tried(tried: Try) -> None:
    """One mistake with results that come at once does not fail every two-stage command."""
    cases = tried(WaitsATurnLater, "4/10", "3/13", "4.15/1", "4.17/1", "4.24/1")
    failed = {case for case, verdict in cases.items() if verdict is Verdict.FAIL}
    assert "4/10" in failed
    assert {case.partition(".")[0] for case in failed} == {"4/10"}
