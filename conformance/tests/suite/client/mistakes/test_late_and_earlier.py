"""Mistakes of clients with late messages, and with what an earlier operation has left."""

from collections.abc import Callable, Mapping
from typing import Any

import pytest

from scaraspec.client import AsyncClient, ClientCore
from scaraspec.client.core import Event
from scaraspec.client.errors import ReplyTimeout
from scaraspec.client.operations import Call
from scaraspec.client.pending_operation import (
    PendingOperation,
    ProgramListing,
    Stage,
    TwoStage,
)
from scaraspec.judge.verdicts import Verdict
from scaraspec.protocol.commands import BY_NAME, parse_frame
from scaraspec.protocol.direction import C2A
from scaraspec.protocol.frames import Frame, Framer

Try = Callable[..., Mapping[str, Verdict]]


def _with(operation: type[PendingOperation], *names: str) -> type[ClientCore]:
    """Return a client whose commands of these names are such operations."""

    class Core(ClientCore):
        def command(self, name: str, value: Any = None) -> PendingOperation:
            if name not in names:
                return super().command(name, value)
            return operation(BY_NAME[name], value, self.dialect)

    return Core


class SentTwice(TwoStage):
    """Sent again after two seconds without a reply."""

    count = 0

    def _send_request(self, now_s: float) -> list[Frame]:
        frames = super()._send_request(now_s)
        self.count += 1
        self.deadline_s = now_s + 2 if self.count == 1 else self.deadline_s
        return frames

    def expire(self, now_s: float) -> list[Frame]:
        if self.stage is Stage.REQUESTED and self.count == 1:
            return self._send_request(now_s)
        return super().expire(now_s)


class DoneAfterStop(TwoStage):
    """Reported as done if a stop has ended it and its own result does not come."""

    def interrupt(self, reason: str) -> None:  # noqa: ARG002 - overrides
        self.settle(None)


class EndsAfterTwentySeconds(TwoStage):
    """Reported as failed twenty seconds after the first reply."""

    longest_s = 20

    def _accept(self, value: Any, now_s: float) -> list[Frame]:
        frames = super()._accept(value, now_s)
        self.deadline_s = now_s + self.longest_s
        return frames


class EndsAfterFiveSeconds(EndsAfterTwentySeconds):
    """Reported as failed five seconds after the first reply."""

    longest_s = 5


class ListsAddUp(ProgramListing):
    """Begins with the names of a list that was cut off."""

    kept: tuple[bytes, ...] = ()

    def _accept(self, value: Any, now_s: float) -> list[Frame]:
        if not self._parts_received:
            self._names += self.kept
        frames = super()._accept(value, now_s)
        type(self).kept = tuple(self._names) if value.more else ()
        return frames


class CountsMissedReplies(ClientCore):
    """The next reply of any command is dropped for each reply that did not come."""

    missed = 0

    def tick(self, now_s: float) -> list[Event]:
        before = tuple(self._open)
        events = super().tick(now_s)
        self.missed += sum(isinstance(each.error, ReplyTimeout) for each in before)
        self._owed.clear()
        return events

    def _dispatch(self, frame: Frame, now_s: float) -> list[Event]:
        parsed = parse_frame(frame)
        if self.missed and parsed is not None and parsed.part == "reply":
            self.missed -= 1
            return []
        return super()._dispatch(frame, now_s)


class EndsAtEndByte(ClientCore):
    """A segment that ends with 0xAA ends a frame."""

    def feed(self, data: bytes, now_s: float) -> list[Event]:
        events = super().feed(data, now_s)
        if data.endswith(b"\xaa"):
            self._framer = Framer(C2A)
        return events


class BeginsAtStartByte(ClientCore):
    """A segment that begins with 0xCC begins a frame."""

    def feed(self, data: bytes, now_s: float) -> list[Event]:
        if data.startswith(b"\xcc"):
            self._framer = Framer(C2A)
        return super().feed(data, now_s)


class ReconnectsWithoutLogin(AsyncClient):
    """Opens a new connection for the next command after a lost link, and does not log in."""

    async def _begin(self, call: Call) -> Any:
        if self._core._lost_reason is not None and self._core.logged_in:
            self._core, password = type(self._core)(self._core.dialect), self._password
            self._password, self._core.logged_in = None, True
            await self.connect()
            self._password = password
        return await super()._begin(call)


@pytest.mark.parametrize(
    ("make", "only", "case"),
    [
        (_with(SentTwice, "set_tool_coordinates"), "4/16", "4/16.late-reply"),
        (_with(DoneAfterStop, "run_program"), "4.17/9", "4.17/9.run_program"),
        (_with(EndsAfterTwentySeconds, "run_program"), "4/11", "4/11"),
        (_with(EndsAfterFiveSeconds, "lock_joints"), "4/11", "4/11"),
        (_with(ListsAddUp, "list_programs"), "4.10/10", "4.10/10.many"),
        (CountsMissedReplies, "3/33", "3/33.late-again"),
        (EndsAtEndByte, "3/9", "3/9"),
        (BeginsAtStartByte, "3/9", "3/9"),
        (ReconnectsWithoutLogin, "4/16", "2/10.seen-1"),
    ],
)
def test_fault_is_detected(
    tried: Try, make: type[ClientCore] | type[AsyncClient], only: str, case: str
) -> None:
    """The case fails, or the judge finds it during the case."""
    assert tried(make, only)[case] is Verdict.FAIL
