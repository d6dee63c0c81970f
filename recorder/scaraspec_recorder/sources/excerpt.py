"""A part of a capture for others: a span of time, with masked passwords on request."""

from collections.abc import Iterator, Mapping
from typing import Final

from scaraspec.protocol.direction import Direction
from scaraspec.traffic.wire import Kind, WireEvent
from scaraspec.user_message import UserMessage
from scaraspec_recorder.sinks.mcap.mcap_sink import MASKED, PASSWORDS
from scaraspec_recorder.sinks.redaction import Redactor
from scaraspec_recorder.sources.mcap_reader import McapCapture
from scaraspec_recorder.sources.pcap_reader import PcapCapture

_HELD_BACK_NS: Final = 250_000_000


class Excerpt:
    """The wire events of a part of a capture. Each iteration reads the file again.

    Of a connection that began before, the earlier bytes of each direction are a gap.

    Args:
        capture: The capture.
        since_ns: Events from this time on, in nanoseconds since the Unix epoch; None for all.
        until_ns: Events before this time; None for all.
        redact: Whether passwords are masked.

    Attributes:
        needs_login: As in the capture.
        empty: Whether the last iteration found no event.
    """

    def __init__(
        self,
        capture: McapCapture | PcapCapture,
        *,
        since_ns: int | None = None,
        until_ns: int | None = None,
        redact: bool = False,
    ) -> None:
        self.needs_login = capture.needs_login
        self.empty = True
        self._capture = capture
        self._since_ns, self._until_ns, self._redact = since_ns, until_ns, redact

    @property
    def session(self) -> Mapping[str, str]:
        """The description of the session in the capture."""
        masked = {PASSWORDS: MASKED} if self._redact else {}
        return {**self._capture.session, **masked}

    def __iter__(self) -> Iterator[WireEvent]:
        """Read the file.

        Raises:
            CaptureError: The file cannot be read.
        """
        self.empty = True
        # Earlier passwords are masked where they occur again.
        events = _redacted(self._capture) if self._redact else iter(self._capture)
        notes: dict[str, str] = {}  # addresses of the open connections that began before
        ends: dict[tuple[str, Direction], int] = {}
        for event in events:
            name = event.connection
            if self._since_ns is None or event.time_ns >= self._since_ns:
                if self._until_ns is None or event.time_ns < self._until_ns:
                    if event.kind is not Kind.OPENED and name in notes:
                        yield from _bytes_before(event, notes[name], ends)
                    notes.pop(name, None)
                    self.empty = False
                    yield event
                continue
            if event.kind in (Kind.CLOSED, Kind.RESET):
                notes.pop(name, None)
                continue
            if event.kind is Kind.OPENED:
                ends.update({(name, direction): 0 for direction in Direction})
            notes[name] = notes.get(name) or event.note
            length_bytes = len(event.data) + max(event.length_bytes, 0)
            ends[name, event.direction] = event.offset_bytes + length_bytes


def _bytes_before(
    first: WireEvent, note: str, ends: Mapping[tuple[str, Direction], int]
) -> Iterator[WireEvent]:
    """Yield a gap for each direction that had bytes before the first event of an excerpt."""
    for direction in Direction:
        if length_bytes := ends.get((first.connection, direction), 0):
            text = (
                UserMessage("before this excerpt ({note})", note=note)
                if note
                else "before this excerpt"
            )
            place = (first.time_ns, first.connection, direction)
            yield WireEvent(*place, Kind.GAP, b"", 0, length_bytes, text)


def _redacted(events: McapCapture | PcapCapture) -> Iterator[WireEvent]:
    """Yield the events with masked passwords, in the order of time."""
    redactor = Redactor()
    ready: list[WireEvent] = []
    begun_ns: int | None = None
    for event in events:
        if begun_ns is None or event.time_ns - begun_ns >= _HELD_BACK_NS:
            ready += redactor.flush()
            yield from sorted(ready, key=lambda each: each.time_ns)
            ready.clear()
            begun_ns = event.time_ns
        ready += redactor.feed(event)
    ready += redactor.flush()
    yield from sorted(ready, key=lambda each: each.time_ns)
