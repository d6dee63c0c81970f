"""Connection: one connection to the subject, in either role of the suite.

Bytes are sent as a case gives them. Received bytes are framed, timestamped and kept until they are
read. The observer sees everything. This module does not know the meaning of a frame, and which
frame is expected.
"""

import math
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from typing import Any, Final, NamedTuple, Protocol

from scaraspec.protocol.direction import A2C, Direction
from scaraspec.protocol.fields import show
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.payloads import Acceptance, Outcome
from scaraspec.suite.engine.expectations import CaseFailed, CaseInconclusive, NoReply, NotConnected
from scaraspec.suite.engine.observer import Observer
from scaraspec.traffic.events import FrameSeen, InvalidBytes
from scaraspec.traffic.stream import Stream
from scaraspec.traffic.wire import UNJUDGED, Kind, WireEvent
from scaraspec.transports.link import Arrival, Ending, Link, LinkError
from scaraspec.user_message import UserMessage

_NS: Final = 1_000_000_000
_MAX_DELAY_S: Final = 25.0
"""How much longer the suite waits for a late message, in seconds."""
_FLOOD_BYTES: Final = 2**16
_FLOOD_RATIO: Final = 64
"""A subject floods if it sends more than this plus this multiple of what the suite sent last."""


class ConnectionOwner(Protocol):
    """The owner of the connections of a run."""

    observer: Observer

    @property
    def now_ns(self) -> int:
        """The current time in nanoseconds since the Unix epoch."""

    def pump_others(self, line: "Connection", /) -> Sequence[Link]:
        """Receive on the other connections. Return the links that may receive more."""


class ReceivedFrame(NamedTuple):
    """A frame that the subject sent.

    Attributes:
        seen: The frame, with its position and time.
        value: Its decoded value; None if it has none.
    """

    seen: FrameSeen
    value: Any

    @property
    def frame(self) -> Frame:
        """The frame."""
        return self.seen.frame

    @property
    def time_s(self) -> float:
        """When its first byte arrived, in seconds since the Unix epoch."""
        return self.seen.begun_ns / _NS

    @property
    def accepted(self) -> bool | None:
        """Whether it accepts the request; None if it is not such a reply."""
        if isinstance(self.value, Acceptance):
            return self.value.accepted
        return self.value if isinstance(self.value, bool) else None

    @property
    def code(self) -> str | None:
        """Its code of table 8-1, if any."""
        return self.value.code if isinstance(self.value, Acceptance | Outcome) else None

    @property
    def done(self) -> bool | None:
        """Whether a final result reports success; None for another frame."""
        return self.value.done if isinstance(self.value, Outcome) else None

    def __str__(self) -> str:
        return f"{self.frame}"


class Connection:
    """One connection.

    Args:
        name: Its name in the recording.
        link: The byte link.
        owner: The owner of all connections of the run.
        sends: The direction in which the suite sends.
        judged: Whether the judge watches the connection.

    Attributes:
        inbox: Received frames that were not read yet, in order.
        invalid_bytes: Received bytes that are not part of a frame.
        ending: How the subject ended the connection; None while it is open.
        closed: The suite has closed the connection.
        closed_ns: When the suite closed it, in nanoseconds since the Unix epoch.
    """

    def __init__(
        self, name: str, link: Link, owner: ConnectionOwner, sends: Direction, *, judged: bool
    ) -> None:
        self.name = name
        self.inbox: list[FrameSeen] = []
        self.invalid_bytes: list[InvalidBytes] = []
        self.ending: Ending | None = None
        self.closed, self.closed_ns = False, 0
        self._flood_limit_bytes = _FLOOD_BYTES
        self.link, self._owner, self._judged = link, owner, judged
        self._sends, self._receives = sends, sends.opposite
        self._streams = {direction: Stream(name, direction) for direction in Direction}
        self._offsets_bytes = dict.fromkeys(Direction, 0)
        self._event(A2C, Kind.OPENED, owner.now_ns, note="" if judged else UNJUDGED)

    # ------------------------------------------------------------------ sending

    def send_bytes(self, data: bytes) -> None:
        """Send bytes as they are.

        Raises:
            NoReply: The subject has ended the connection.
        """
        if not data:
            return
        self.pump()  # bytes received so far precede these
        try:
            with self._owner.observer.interruption:
                time_ns = self.link.send(data)
                self._flood_limit_bytes = _FLOOD_BYTES + _FLOOD_RATIO * len(data)
                self._event(self._sends, Kind.BYTES, time_ns, data)
        except LinkError as error:
            self.pump()
            raise NotConnected(
                UserMessage("the subject does not receive what is sent: {error}", error=error)
            ) from None

    def send_frame(self, frame: Frame) -> None:
        """Send one frame."""
        self.send_bytes(frame.encode())

    def wait(self, for_s: float) -> None:
        """Receive for a time, in seconds; return early if the connection ends."""
        deadline_s = self.link.now_s + for_s
        while self._more(deadline_s) and self.link.now_s <= deadline_s:
            pass

    def ends(self, *, within_s: float) -> Ending | None:
        """Wait for the subject to end the connection; return None if it does not."""
        self.wait(within_s)
        if self.ending is None:
            self._owner.observer.report_late(self.name)
        return self.ending

    def wait_for_frame(
        self, is_expected: Callable[[FrameSeen], bool], within_s: float, message: str
    ) -> ReceivedFrame:
        """Wait for a frame, and remove it from the inbox.

        Args:
            is_expected: Whether a frame is the expected one.
            within_s: The timeout in seconds.
            message: The message of the failure.

        Raises:
            NoReply: No such frame arrived in time.
        """
        deadline_s = self.link.now_s + within_s
        while True:
            for seen in self.inbox:
                if is_expected(seen):
                    self.inbox.remove(seen)
                    return ReceivedFrame(seen, seen.value)
            if self.link.now_s > deadline_s or not self._more(deadline_s):
                if self.unfinished:
                    message = UserMessage.joined(message, " completely")
                if not self.ending:
                    message = UserMessage.joined(message, " in {within_s:g} s", within_s=within_s)
                raise self.no_reply_error(message)

    def await_late(self, is_due: Callable[[FrameSeen], bool]) -> None:
        """Wait longer for a frame that was due, if the attempt is not repeated; see `attempts`.

        Args:
            is_due: Whether a frame is the one that was due.
        """
        attempt = self._owner.observer.attempt
        if attempt.repeatable:
            return
        deadline_s = self.link.now_s + _MAX_DELAY_S
        while not any(map(is_due, self.inbox)):
            if self.link.now_s > deadline_s or not self._more(deadline_s):
                return
        attempt.delayed = True

    def wait_for_any(self, within_s: float) -> bool:
        """Wait for a frame and leave it in the inbox; return whether one is there."""
        deadline_s = self.link.now_s + within_s
        while not self.inbox and self.link.now_s <= deadline_s and self._more(deadline_s):
            pass
        return bool(self.inbox)

    def no_reply_error(self, message: str) -> NoReply:
        """Return what to raise if a message that was due has not arrived."""
        self._owner.observer.report_late(self.name)
        came: list[str] = [f"{seen.frame}" for seen in self.inbox]
        came += [
            UserMessage("no frame: {data}", data=show(noise.data)) for noise in self.invalid_bytes
        ]
        if self.unfinished:
            came.append("a part of a frame")
        if self.ending:
            ending = UserMessage(self.ending.value)
            came.append(UserMessage("the connection was {value}", value=ending))
        observed = UserMessage.listed(came, semicolons=True) or "silence"
        return NoReply(message, expected="an answer", observed=observed)

    # ------------------------------------------------------------------ listening

    def pump(self) -> None:
        """Receive what has already arrived, without waiting."""
        while self._receive(self.link.now_s):
            pass

    def flush(self) -> None:
        """Classify received bytes as invalid if no frame can begin with them."""
        self._take(self._receives, self._streams[self._receives].flush())

    def finish(self) -> None:
        """Classify an unfinished frame as invalid, too, because the rest of it does not follow."""
        self._take(self._receives, self._streams[self._receives].finish())

    def _more(self, deadline_s: float) -> bool:
        """Receive one arrival; return False after the deadline or the end of the connection."""
        while True:
            if self.ended:
                return False
            others = self._owner.pump_others(self)
            until_s = min(deadline_s, self.link.now_s + self.link.step_s, self._silence_ends_s)
            if self._receive(until_s, others) or self._find_replies():
                return True
            if self.link.now_s >= deadline_s:
                return self._receive(deadline_s)  # it may have arrived while this machine stalled

    @property
    def _silence_ends_s(self) -> float:
        """When `_find_replies` can find more than now, on the clock of the link; else infinity."""
        ends_ns, now_ns = self._streams[self._receives].silence_ends_ns, self._owner.now_ns
        if ends_ns is None or ends_ns <= now_ns:
            return math.inf
        return self.link.now_s + (ends_ns - now_ns) / _NS

    def _find_replies(self) -> bool:
        """Find the replies that were read as data of a frame with a wrong length."""
        known = len(self.inbox)
        found = self._streams[self._receives].end_silent_frame(self._owner.now_ns)
        self._take(self._receives, found)
        return len(self.inbox) > known

    @property
    def mid_frame(self) -> bool:
        """Whether the suite has sent a part of a frame."""
        return self._streams[self._sends].buffered_bytes > 0

    @property
    def unfinished(self) -> bool:
        """Whether the subject has sent a part of a frame."""
        return self._streams[self._receives].buffered_bytes > 0

    @property
    def ended(self) -> bool:
        """Whether the suite or the subject has ended the connection."""
        return self.closed or self.ending is not None

    def _receive(self, deadline_s: float, others: Sequence[Link] = ()) -> bool:
        """Receive one arrival; return False if something arrived on another link first."""
        if self.ended:
            return False
        with self._owner.observer.interruption:
            try:
                arrival = self.link.receive(deadline_s, others)
            except LinkError:
                arrival = Arrival(self._owner.now_ns, Ending.RESET)
            if arrival is None:
                return False
            if isinstance(arrival.content, Ending):
                self.ending = arrival.content
                kind = Kind.RESET if arrival.content is Ending.RESET else Kind.CLOSED
                self._take(self._receives, self._streams[self._receives].finish())
                self._event(self._receives, kind, arrival.time_ns)
            else:
                self._event(self._receives, Kind.BYTES, arrival.time_ns, arrival.content)
                self._check_flood(len(arrival.content))
            return True

    def _check_flood(self, size_bytes: int) -> None:
        self._flood_limit_bytes -= size_bytes
        if self._flood_limit_bytes < 0:
            self._finish_close(self.link.reset, Kind.RESET)
            message = "the subject keeps sending frames that no request asked for"
            raise CaseFailed(message, expected="silence", observed="a flood", requirement="3/32")

    def _event(
        self, direction: Direction, kind: Kind, time_ns: int, data: bytes = b"", *, note: str = ""
    ) -> None:
        offset_bytes = self._offsets_bytes[direction]
        event = WireEvent(time_ns, self.name, direction, kind, data, offset_bytes, note=note)
        self._offsets_bytes[direction] += len(data)
        with self._owner.observer.interruption:
            self._owner.observer.event(event, judged=self._judged)
            if data:
                self._take(direction.opposite, self._streams[direction.opposite].settle())
                self._take(direction, self._streams[direction].feed(event))

    def _take(self, direction: Direction, items: Iterable[FrameSeen | InvalidBytes]) -> None:
        for item in items:
            self._owner.observer.frame(item)
            if direction is self._sends:
                if isinstance(item, FrameSeen):
                    self._sent(item)
            elif isinstance(item, FrameSeen):
                self.inbox.append(item)
                self._received(item)
            else:
                self.invalid_bytes.append(item)

    def _sent(self, seen: FrameSeen) -> None:
        """Handle a frame that was sent completely; subclasses override this."""

    def _received(self, seen: FrameSeen) -> None:
        """Handle a complete frame of the subject; subclasses override this."""

    # ------------------------------------------------------------------ ending

    def half_close(self) -> None:
        """Close the sending direction and keep receiving.

        Raises:
            CaseInconclusive: The link does not support this.
        """
        try:
            self.link.half_close()
        except LinkError as error:
            raise CaseInconclusive(
                UserMessage("this link cannot be closed in one direction: {error}", error=error)
            ) from None
        self._event(self._sends, Kind.HALF_CLOSED, self._owner.now_ns)

    def close(self) -> None:
        """Close the connection."""
        self._end(self.link.close, Kind.CLOSED)

    def reset(self) -> None:
        """Reset the connection."""
        self._end(self.link.reset, Kind.RESET)

    def _end(self, end: Callable[[], None], kind: Kind) -> None:
        with suppress(CaseFailed):  # a flood has reset it
            self.pump()
        if not self.closed:
            self._finish_close(end, kind)

    def _finish_close(self, end: Callable[[], None], kind: Kind) -> None:
        self.closed, self.closed_ns = True, self._owner.now_ns
        end()
        if self.ending is None:
            self._event(self._sends, kind, self._owner.now_ns)


def pump_all(lines: Iterable[Connection], excluded: Connection) -> list[Link]:
    """Receive on all connections but one. Return the links of those that are still open."""
    links = []
    for line in lines:
        if line is not excluded and not line.ended:
            line.pump()
            if not line.ended:
                links.append(line.link)
    return links
