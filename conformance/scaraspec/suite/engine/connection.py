"""Wire: one connection to the subject, whichever end of it the suite plays.

Bytes are sent as a case gives them. Received bytes are framed, timed and kept until they are read,
so that nothing that a subject sends goes unseen; all of it is observed. What a frame means, and
which is due, is not known here.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from typing import Any, Final, NamedTuple, Protocol

from scaraspec.protocol.direction import A2C, Direction
from scaraspec.protocol.fields import show
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.payloads import Acceptance, Outcome
from scaraspec.suite.engine.expectations import CaseFailed, CaseInconclusive, NoReply
from scaraspec.suite.engine.observer import Observer
from scaraspec.traffic.events import FrameSeen, InvalidBytes
from scaraspec.traffic.stream import Stream
from scaraspec.traffic.wire import Kind, WireEvent
from scaraspec.transports.link import Arrival, Ending, Link, LinkError
from scaraspec.user_message import UserMessage

_NS: Final = 1_000_000_000
_FLOOD_BYTES: Final = 2**16
_FLOOD_RATIO: Final = 64
"""A subject that sends more than this, and so many times what it was sent last, sends forever."""


class ConnectionOwner(Protocol):
    """The owner of the connections of a run."""

    observer: Observer

    @property
    def now_ns(self) -> int:
        """The present instant in nanoseconds since the Unix epoch."""

    def pump_others(self, wire: "Connection", /) -> Sequence[Link]:
        """Take what came elsewhere; give the links on which more may come."""


class ReceivedFrame(NamedTuple):
    """What a subject sent.

    Attributes:
        seen: The frame, and where and when it was.
        value: Its decoded value; None where it has none.
    """

    seen: FrameSeen
    value: Any

    @property
    def frame(self) -> Frame:
        """The frame."""
        return self.seen.frame

    @property
    def time_s(self) -> float:
        """When its first byte came, in seconds since the Unix epoch."""
        return self.seen.begun_ns / _NS

    @property
    def accepted(self) -> bool | None:
        """Whether it says yes; None where it says neither."""
        if isinstance(self.value, Acceptance):
            return self.value.accepted
        return self.value if isinstance(self.value, bool) else None

    @property
    def code(self) -> str | None:
        """The code of table 8-1 that it bears, if any."""
        return self.value.code if isinstance(self.value, Acceptance | Outcome) else None

    @property
    def done(self) -> bool | None:
        """Of a final result: whether it says done."""
        return self.value.done if isinstance(self.value, Outcome) else None

    def __str__(self) -> str:
        return f"{self.frame}"


class Connection:
    """One connection.

    Args:
        name: Its name in the recording.
        link: What carries it.
        holder: Its owner.
        ours: The direction in which the suite sends.
        judged: Whether the judge watches it.

    Attributes:
        inbox: Received frames that were not read yet, in order.
        invalid_bytes: What came and was no frame.
        ending: How the subject ended it; None while it is open.
        closed: It was ended by the suite.
        closed_ns: When.
    """

    def __init__(
        self, name: str, link: Link, holder: ConnectionOwner, ours: Direction, *, judged: bool
    ) -> None:
        self.name = name
        self.inbox: list[FrameSeen] = []
        self.invalid_bytes: list[InvalidBytes] = []
        self.ending: Ending | None = None
        self.closed, self.closed_ns = False, 0
        self._due_bytes = _FLOOD_BYTES
        self.link, self._holder, self._judged = link, holder, judged
        self._ours, self._theirs = ours, ours.opposite
        self._streams = {direction: Stream(name, direction) for direction in Direction}
        self._offsets_bytes = dict.fromkeys(Direction, 0)
        self._event(A2C, Kind.OPENED, holder.now_ns)

    # ------------------------------------------------------------------ sending

    def send_bytes(self, data: bytes) -> None:
        """Send bytes as they are.

        Raises:
            NoReply: The subject has ended the connection.
        """
        if not data:
            return
        self.pump()  # what has come so far came before this
        try:
            with self._holder.observer.interruption:
                time_ns = self.link.send(data)
                self._due_bytes = _FLOOD_BYTES + _FLOOD_RATIO * len(data)
                self._event(self._ours, Kind.BYTES, time_ns, data)
        except LinkError as error:
            self.pump()
            raise NoReply(
                UserMessage("the subject does not take what is sent: {error}", error=error)
            ) from None

    def send_frame(self, frame: Frame) -> None:
        """Send one frame."""
        self.send_bytes(frame.encode())

    def wait(self, for_s: float) -> None:
        """Let time pass, listening; it ends early only with the connection."""
        deadline_s = self.link.now_s + for_s
        while self._more(deadline_s) and self.link.now_s <= deadline_s:
            pass

    def ends(self, *, within_s: float) -> Ending | None:
        """Wait for the subject to end the connection; None if it does not."""
        self.wait(within_s)
        if self.ending is None:
            self._holder.observer.report_late(self.name)
        return self.ending

    def wait_for_frame(
        self, wanted: Callable[[FrameSeen], bool], within_s: float, message: str
    ) -> ReceivedFrame:
        """Wait for a frame, and take it.

        Raises:
            NoReply: None came; the message says what was due.
        """
        deadline_s = self.link.now_s + within_s
        while True:
            for seen in self.inbox:
                if wanted(seen):
                    self.inbox.remove(seen)
                    return ReceivedFrame(seen, seen.value)
            if self.link.now_s > deadline_s or not self._more(deadline_s):
                when = "" if self.ending else f" in {within_s:g} s"
                raise self.no_reply_error(f"{message}{when}")

    def wait_for_any(self, within_s: float) -> bool:
        """Wait for a frame and leave it in the inbox; return whether one is there."""
        deadline_s = self.link.now_s + within_s
        while not self.inbox and self.link.now_s <= deadline_s and self._more(deadline_s):
            pass
        return bool(self.inbox)

    def no_reply_error(self, message: str) -> NoReply:
        """Return what to raise if a message that was due has not arrived."""
        self._holder.observer.report_late(self.name)
        came = [f"{seen.frame}" for seen in self.inbox]
        came += [f"no frame: {show(noise.data)}" for noise in self.invalid_bytes]
        if self.ending:
            came.append(f"the connection was {self.ending.value}")
        return NoReply(message, expected="an answer", observed="; ".join(came) or "silence")

    # ------------------------------------------------------------------ listening

    def pump(self) -> None:
        """Take what is there already, without waiting."""
        while self._receive(self.link.now_s):
            pass

    def flush(self) -> None:
        """Take for noise what has come and begins no frame, whatever may follow it."""
        self._take(self._theirs, self._streams[self._theirs].flush())

    def finish(self) -> None:
        """Take for noise an unfinished frame, too, because the rest of it does not come."""
        self._take(self._theirs, self._streams[self._theirs].finish())

    def _more(self, deadline_s: float) -> bool:
        """Wait for anything to come; False once the time is up or the connection has ended."""
        while True:
            if self.ended:
                return False
            others = self._holder.pump_others(self)
            if self._receive(min(deadline_s, self.link.now_s + self.link.step_s), others):
                return True
            if self.link.now_s >= deadline_s:
                return self._receive(deadline_s)  # it may have come while this machine stood still

    @property
    def mid_frame(self) -> bool:
        """Whether a frame has been sent in part."""
        return self._streams[self._ours].buffered_bytes > 0

    @property
    def unfinished(self) -> bool:
        """Whether a frame has come in part, of which the rest may follow."""
        return self._streams[self._theirs].buffered_bytes > 0

    @property
    def ended(self) -> bool:
        """Whether it has been ended, by whomever."""
        return self.closed or self.ending is not None

    def _receive(self, deadline_s: float, others: Sequence[Link] = ()) -> bool:
        """Take one arrival; whether there was one before anything came elsewhere."""
        if self.ended:
            return False
        with self._holder.observer.interruption:
            try:
                arrival = self.link.receive(deadline_s, others)
            except LinkError:
                arrival = Arrival(self._holder.now_ns, Ending.RESET)
            if arrival is None:
                return False
            if isinstance(arrival.content, Ending):
                self.ending = arrival.content
                kind = Kind.RESET if arrival.content is Ending.RESET else Kind.CLOSED
                self._take(self._theirs, self._streams[self._theirs].finish())
                self._event(self._theirs, kind, arrival.time_ns)
            else:
                self._event(self._theirs, Kind.BYTES, arrival.time_ns, arrival.content)
                self._check_flood(len(arrival.content))
            return True

    def _check_flood(self, size_bytes: int) -> None:
        self._due_bytes -= size_bytes
        if self._due_bytes < 0:
            self._over(self.link.reset, Kind.RESET)
            message = "the subject goes on sending what nobody has asked for"
            raise CaseFailed(message, expected="silence", observed="a flood", requirement="3/32")

    def _event(self, direction: Direction, kind: Kind, time_ns: int, data: bytes = b"") -> None:
        offset_bytes = self._offsets_bytes[direction]
        event = WireEvent(time_ns, self.name, direction, kind, data, offset_bytes)
        self._offsets_bytes[direction] += len(data)
        with self._holder.observer.interruption:
            self._holder.observer.event(event, judged=self._judged)
            if data:
                self._take(direction.opposite, self._streams[direction.opposite].settle())
                self._take(direction, self._streams[direction].feed(event))

    def _take(self, direction: Direction, found: "Iterator[FrameSeen | InvalidBytes]") -> None:
        for item in found:
            self._holder.observer.frame(item)
            if direction is self._ours:
                if isinstance(item, FrameSeen):
                    self._sent(item)
            elif isinstance(item, FrameSeen):
                self.inbox.append(item)
                self._received(item)
            else:
                self.invalid_bytes.append(item)

    def _sent(self, seen: FrameSeen) -> None:
        """A sent frame is complete; automatic responders override this."""

    def _received(self, seen: FrameSeen) -> None:
        """A frame of the subject is whole."""

    # ------------------------------------------------------------------ ending

    def half_close(self) -> None:
        """Send no more, but listen on.

        Raises:
            CaseInconclusive: This carrier cannot.
        """
        try:
            self.link.half_close()
        except LinkError as error:
            raise CaseInconclusive(
                UserMessage("this link cannot do that: {error}", error=error)
            ) from None
        self._event(self._ours, Kind.HALF_CLOSED, self._holder.now_ns)

    def close(self) -> None:
        """End the connection in order."""
        self._end(self.link.close, Kind.CLOSED)

    def reset(self) -> None:
        """Cut the connection off."""
        self._end(self.link.reset, Kind.RESET)

    def _end(self, end: Callable[[], None], kind: Kind) -> None:
        with suppress(CaseFailed):  # a flood ends it by itself
            self.pump()
        if not self.closed:
            self._over(end, kind)

    def _over(self, end: Callable[[], None], kind: Kind) -> None:
        self.closed, self.closed_ns = True, self._holder.now_ns
        end()
        if self.ending is None:
            self._event(self._ours, kind, self._holder.now_ns)


def pump_all(wires: Iterable[Connection], besides: Connection) -> list[Link]:
    """Take what is there on all wires but one; give the links of those that are still open."""
    links = []
    for wire in wires:
        if wire is not besides and not wire.ended:
            wire.pump()
            if not wire.ended:
                links.append(wire.link)
    return links
