"""Passages: bytes as a recorder in the way saw them, when they came in and when they went on.

Law: what is known of a passage beyond a wire event, and what follows for an exchange: how much of
its latency is the robot's and how much is the recorder's own. Who took the times is not known here.
"""

from dataclasses import dataclass
from typing import Final, NamedTuple

from scaraspec.traffic.events import Exchange, FrameSeen
from scaraspec.traffic.wire import WireEvent, WireRange

_MOST_OPEN: Final = 4096


@dataclass(frozen=True, slots=True)
class ForwardedChunk(WireEvent):
    """Bytes that a recorder passed on; `time_ns` is when they came in.

    Attributes:
        forwarded_ns: When they had been passed on: written, or queued behind what the other side
            had not taken yet; 0 where nobody knows.
        kernel_time: Whether they came in by the system's clock of receipt; else `time_ns` is when
            the recorder read them.
    """

    forwarded_ns: int = 0
    kernel_time: bool = False


class Latency(NamedTuple):
    """Whose the time between a request and its first reply was.

    Attributes:
        robot_ns: From the request's passing on to the first byte of the reply: the controller's
            time, and that of the wire to it.
        recorder_ns: What passing on has added, both ways.
    """

    robot_ns: int
    recorder_ns: int


class LatencyTracker:
    """Follows the frames of a recording, and tells of each exchange whose its latency was."""

    def __init__(self) -> None:
        self._last: WireEvent | None = None
        self._passages: dict[
            WireRange, ForwardedChunk
        ] = {}  # of frames whose exchange may still come

    def write(self, event: WireEvent) -> None:
        """Take a raw event."""
        self._last = event

    def frame(self, seen: FrameSeen) -> None:
        """Take a frame that the last raw event brought about."""
        last, place = self._last, seen.place
        if (
            isinstance(last, ForwardedChunk)
            and last.forwarded_ns
            and (last.connection, last.direction) == (place.connection, place.direction)
            and last.time_ns == place.time_ns  # else it was complete before, and held back
        ):
            self._passages[place] = last
            if len(self._passages) > _MOST_OPEN:
                del self._passages[next(iter(self._passages))]

    def exchange(self, exchange: Exchange) -> Latency | None:
        """Return whose the latency of an exchange was; None where there is none, or no telling."""
        request = self._passages.pop(exchange.request.place, None)
        reply = exchange.reply
        answer = self._passages.pop(reply.place, None) if reply else None
        if not (request and reply and answer):
            return None
        added_ns = request.forwarded_ns - request.time_ns + answer.forwarded_ns - answer.time_ns
        return Latency(reply.begun_ns - request.forwarded_ns, added_ns)
