"""Triggers: conditions on the traffic, written as text.

Each condition has a class that receives events, derived items and the time, and returns the reason
when it fires. The tables at the end define the syntax. `marks` writes the marks.

A condition is a word, most with an argument after a colon:

    code:12          a refusal, a failed result or a new status has this code of table 8-1
    refusal          a first reply refuses the request
    finding:4.15/3   this requirement is violated
    finding:fail     any requirement is violated; also tolerated, inconclusive, error
    silence:30s      no bytes on an open connection for this time
    late:500ms       a first reply takes longer, or is missing for this time
    malformed        bytes are not a frame, or the payload of a frame is malformed
    disconnect       a connection was closed or reset
    gap              bytes were forwarded, but not recorded
    signal           the recorder received SIGUSR1
"""

import reprlib
from collections import deque
from collections.abc import Callable
from typing import Final

from scaraspec.judge.requirements import UnknownRequirementError, requirement
from scaraspec.judge.verdicts import Finding, Verdict
from scaraspec.protocol.errors import lookup
from scaraspec.protocol.payloads import Acceptance, Outcome
from scaraspec.traffic.events import CaptureGap, FrameSeen, InvalidBytes, LinkChange
from scaraspec.traffic.wire import Kind, WireEvent
from scaraspec.user_message import UserMessage
from scaraspec_recorder.sinks import text as event_text
from scaraspec_recorder.sinks.decoder import Item
from scaraspec_recorder.units import SECOND_NS, QuantityError, parse_duration

SIGNAL: Final = "signal"
"""The condition that the user triggers with a signal, see `UserTrigger`."""

_MAX_PENDING: Final = 256  # pending requests of one command and connection


class TriggerError(ValueError):
    """The text is not a valid condition. The message is one sentence for the user."""


class Trigger:
    """One condition. Each method returns why it fires; empty if it does not.

    Attributes:
        timed: Whether it compares times, and must not fire after a step of the clock.
    """

    timed = False

    def on_event(self, event: WireEvent) -> str:  # noqa: ARG002 - for subclasses
        """Process a raw event."""
        return ""

    def on_item(self, item: Item) -> str:  # noqa: ARG002 - for subclasses
        """Process an item derived from the last event."""
        return ""

    def on_time(self, now_ns: int) -> str:  # noqa: ARG002 - for subclasses
        """Process the current time of the events' clock; all earlier events are known."""
        return ""

    def on_clock_step(self) -> None:
        """Forget times: the clock was set."""


class UserTrigger(Trigger):
    """Fires when the user requests it."""

    def __init__(self) -> None:
        self._requested = False

    def request(self) -> None:
        """Fire at the next tick."""
        self._requested = True

    def on_time(self, now_ns: int) -> str:  # noqa: ARG002 - at any time
        """Return the reason if the user requested a mark."""
        pressed, self._requested = self._requested, False
        return "requested by SIGUSR1" if pressed else ""


class _Code(Trigger):
    """Fires for one code of table 8-1.

    A status fires only when it changes, because clients poll it.
    """

    def __init__(self, text: str) -> None:
        if not (row := lookup(text)):
            raise TriggerError(
                UserMessage(
                    "{text} is not a code of table 8-1, such as 12", text=reprlib.repr(text)
                )
            )
        self._code = row.text
        self._status = ""

    def on_item(self, item: Item) -> str:
        if not isinstance(item, FrameSeen):
            return ""
        value, code = item.value, None
        if isinstance(value, Acceptance | Outcome):
            code = value.code
        elif item.name == "get_status" and isinstance(value, str):
            code = value if value != self._status else None
            self._status = value
        return f"{item.name}: {event_text.frame_text(item)}" if code == self._code else ""


class _Refusal(Trigger):
    def on_item(self, item: Item) -> str:
        if not isinstance(item, FrameSeen) or event_text.part_of(item) != "reply":
            return ""
        value = item.value
        refused = value is False or (isinstance(value, Acceptance) and not value.accepted)
        return f"{item.name}: {event_text.frame_text(item)}" if refused else ""


class _FindingTrigger(Trigger):
    def __init__(self, text: str) -> None:
        verdicts = [verdict.value for verdict in _GIVEN]
        self._verdicts = {Verdict(text)} if text in verdicts else {Verdict.FAIL, Verdict.ERROR}
        self._requirement = ""
        if text not in verdicts:
            try:
                self._requirement = requirement(text).id
            except UnknownRequirementError as error:
                raise TriggerError(
                    UserMessage(
                        "{error} Or name a verdict: {verdicts}.",
                        error=error,
                        verdicts=", ".join(verdicts),
                    )
                ) from None

    def on_item(self, item: Item) -> str:
        if not isinstance(item, Finding) or item.verdict not in self._verdicts:
            return ""
        matches = self._requirement in ("", item.requirement)
        return f"{item.verdict.value} {item.requirement}: {item.message}" if matches else ""


class _Silence(Trigger):
    """Fires if an open connection carries no bytes for a time.

    The time begins at the first tick or byte, so that a late OPENED event does not count as
    silence. Each silence fires once: at a tick, or at the next byte.
    """

    timed = True

    def __init__(self, text: str) -> None:
        self._limit_ns = parse_duration(text)
        self._last_traffic_ns: dict[str, int | None] = {}
        self._fired: set[str] = set()

    def on_event(self, event: WireEvent) -> str:
        connection, why = event.connection, ""
        if event.kind is Kind.OPENED:
            self._last_traffic_ns[connection] = None
        elif event.kind in (Kind.BYTES, Kind.GAP):
            why = self._check(connection, event.time_ns)
            self._last_traffic_ns[connection] = event.time_ns
        elif event.kind in (Kind.CLOSED, Kind.RESET):
            why = self._check(connection, event.time_ns)
            del self._last_traffic_ns[connection]
        if event.kind is not Kind.HALF_CLOSED:
            self._fired.discard(connection)
        return why

    def on_time(self, now_ns: int) -> str:
        return "; ".join(filter(None, (self._check(c, now_ns) for c in self._last_traffic_ns)))

    def on_clock_step(self) -> None:
        self._last_traffic_ns = dict.fromkeys(self._last_traffic_ns)
        self._fired.clear()

    def _check(self, connection: str, now_ns: int) -> str:
        last_ns = self._last_traffic_ns.get(connection)
        if last_ns is None:
            self._last_traffic_ns[connection] = now_ns
        elif now_ns - last_ns >= self._limit_ns and connection not in self._fired:
            self._fired.add(connection)
            return UserMessage(
                "no bytes on connection {connection} for {silent_s:.1f} s",
                connection=connection,
                silent_s=(now_ns - last_ns) / SECOND_NS,
            )
        return ""


class _Late(Trigger):
    """Fires once per late reply: when the limit passes, or when the reply arrives."""

    timed = True

    def __init__(self, text: str) -> None:
        self._limit_ns = parse_duration(text)
        self._pending: dict[
            str, dict[str, deque[int]]
        ] = {}  # request times by connection and command

    def on_clock_step(self) -> None:
        self._pending.clear()

    def on_item(self, item: Item) -> str:
        if isinstance(item, FrameSeen):
            return self._frame(item)
        if isinstance(item, LinkChange | CaptureGap):
            self._pending.pop(item.event.connection, None)
        return ""

    def _frame(self, seen: FrameSeen) -> str:
        part = event_text.part_of(seen)
        pending = self._pending.setdefault(seen.place.connection, {})
        if part == "request":
            pending.setdefault(seen.name, deque(maxlen=_MAX_PENDING)).append(seen.place.time_ns)
        elif part == "reply" and (request_times := pending.get(seen.name)):
            took_ns = seen.begun_ns - request_times.popleft()
            if took_ns > self._limit_ns:
                return UserMessage(
                    "{name} answered after {took_ms:.0f} ms",
                    name=seen.name,
                    took_ms=took_ns / 1e6,
                )
        return ""

    def on_time(self, now_ns: int) -> str:
        late = []
        for pending in self._pending.values():
            for name, request_times in pending.items():
                while request_times and now_ns - request_times[0] > self._limit_ns:
                    late.append(
                        UserMessage(
                            "{name} not answered for {waited_ms:.0f} ms",
                            name=name,
                            waited_ms=(now_ns - request_times.popleft()) / 1e6,
                        )
                    )
        return "; ".join(late)


class _Malformed(Trigger):
    """Fires for bytes that are not a frame and for malformed payloads, except next to a gap."""

    def on_item(self, item: Item) -> str:
        if isinstance(item, InvalidBytes) and item.certain:
            line = event_text.log_line(item)
            return line.text if line else ""
        if (
            isinstance(item, FrameSeen)
            and item.certain
            and (found := event_text.defect_texts(item))
        ):
            return f"{item.name}: {'; '.join(found)}"
        return ""


class _Disconnect(Trigger):
    """Fires when a connection is closed or reset.

    Does not fire if the recorder itself closes the connection after a gap of unknown length.
    """

    def __init__(self) -> None:
        self._unobserved: tuple[str, int] | None = (
            None  # connection and time of the last gap of unknown length
        )

    def on_event(self, event: WireEvent) -> str:
        instant = (event.connection, event.time_ns)
        if event.kind is Kind.GAP and event.length_bytes < 0:
            self._unobserved = instant
        elif event.kind in (Kind.CLOSED, Kind.RESET) and instant != self._unobserved:
            return UserMessage(
                "connection {connection} {event}",
                connection=event.connection,
                event=UserMessage(event.kind.value),
            )
        return ""


class _Gap(Trigger):
    """Fires for each gap in the recording."""

    def on_event(self, event: WireEvent) -> str:
        if event.kind is not Kind.GAP:
            return ""
        size = f"{event.length_bytes}" if event.length_bytes >= 0 else "an unknown number of"
        return UserMessage(
            "connection {connection}: {size} bytes are not recorded: {note}",
            connection=event.connection,
            size=size,
            note=event.note,
        )


_GIVEN: Final = (Verdict.FAIL, Verdict.INCONCLUSIVE, Verdict.TOLERATED, Verdict.ERROR)

_PLAIN: Final[dict[str, Callable[[], Trigger]]] = {
    "refusal": _Refusal,
    "malformed": _Malformed,
    "disconnect": _Disconnect,
    "gap": _Gap,
    SIGNAL: UserTrigger,
}
_WITH_ARGUMENT: Final[dict[str, Callable[[str], Trigger]]] = {
    "code": _Code,
    "finding": _FindingTrigger,
    "silence": _Silence,
    "late": _Late,
}


def parse_trigger(text: str) -> Trigger:
    """Parse a condition.

    Raises:
        TriggerError: The text is not a condition.
    """
    word, colon, argument = text.strip().partition(":")
    try:
        if make := _WITH_ARGUMENT.get(word):
            return make(argument)
        if not colon and (simple := _PLAIN.get(word)):
            return simple()
    except QuantityError as error:
        raise TriggerError(
            UserMessage("{text} is not a trigger: {error}", text=reprlib.repr(text), error=error)
        ) from None
    raise TriggerError(
        UserMessage(
            "{text} is not a trigger: use code:12, refusal, finding:4.15/3, finding:fail, "
            "silence:30s, late:500ms, malformed, disconnect, gap or signal",
            text=reprlib.repr(text),
        )
    )
