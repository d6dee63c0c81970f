"""Forwarded chunks: bytes with the time of reception and the time of forwarding.

From these times, `LatencyTracker` splits the latency of an exchange into the robot's part and the
part that the recorder adds.
"""

from dataclasses import dataclass
from typing import Final, NamedTuple

from scaraspec.traffic.events import Exchange, FrameSeen
from scaraspec.traffic.wire import WireEvent, WireRange

_MAX_OPEN: Final = 4096


@dataclass(frozen=True, slots=True)
class ForwardedChunk(WireEvent):
    """Bytes that a recorder forwarded; `time_ns` is the time of reception.

    Attributes:
        forwarded_ns: Time at which they had been written to the other socket or queued for it; 0 if
            unknown.
        kernel_time: Whether `time_ns` is a kernel timestamp; otherwise it is the time of the read
            call.
    """

    forwarded_ns: int = 0
    kernel_time: bool = False


class Latency(NamedTuple):
    """The two parts of the latency between a request and its first reply.

    Attributes:
        robot_ns: From forwarding the request to receiving the first byte of the reply: time of the
            controller and of the link to it.
        recorder_ns: Delay that forwarding adds, in both directions.
    """

    robot_ns: int
    recorder_ns: int


class LatencyTracker:
    """Computes the parts of the latency of each exchange in a recording."""

    def __init__(self) -> None:
        self._last: WireEvent | None = None
        self._chunks: dict[WireRange, ForwardedChunk] = {}  # frames whose exchange is not complete

    def write(self, event: WireEvent) -> None:
        """Process a raw event."""
        self._last = event

    def frame(self, seen: FrameSeen) -> None:
        """Process a frame that the last raw event completed."""
        last, place = self._last, seen.place
        if (
            isinstance(last, ForwardedChunk)
            and last.forwarded_ns
            and (last.connection, last.direction) == (place.connection, place.direction)
            and last.time_ns
            == place.time_ns  # otherwise the frame was completed by an earlier event
        ):
            self._chunks[place] = last
            if len(self._chunks) > _MAX_OPEN:
                del self._chunks[next(iter(self._chunks))]

    def exchange(self, exchange: Exchange) -> Latency | None:
        """Return the parts of the latency; None without a reply or if a time is unknown."""
        request = self._chunks.pop(exchange.request.place, None)
        reply = exchange.reply
        reply_chunk = self._chunks.pop(reply.place, None) if reply else None
        if not (request and reply and reply_chunk):
            return None
        added_ns = (
            request.forwarded_ns - request.time_ns + reply_chunk.forwarded_ns - reply_chunk.time_ns
        )
        return Latency(reply.begun_ns - request.forwarded_ns, added_ns)
