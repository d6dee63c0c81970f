"""Marks: log lines in a recording when triggers fire.

`triggers` decides when a trigger fires. This module then writes a line into the recording and into
the log of the process. A restarted writer process does not know the earlier traffic: a trigger that
depends on it, such as ``late``, does not fire.
"""

import logging
from collections import Counter, deque
from collections.abc import Mapping, Sequence
from typing import Final

from scaraspec.traffic.wire import WireEvent
from scaraspec_recorder.recordings.trigger_command import TriggerCommand
from scaraspec_recorder.recordings.triggers import Trigger, UserTrigger, parse_trigger
from scaraspec_recorder.sinks.clock_watch import ClockWatch
from scaraspec_recorder.sinks.decoder import Item, Output
from scaraspec_recorder.sinks.file_names import utc_time
from scaraspec_recorder.sinks.sink import OutputFolder
from scaraspec_recorder.sinks.text import Level, LogLine
from scaraspec_recorder.units import SECOND_NS

LOGGED_A_MINUTE: Final = 6
"""Maximum log lines per minute and trigger; the recording contains all marks."""

SOURCE: Final = "trigger"
"""The source that the lines in the recording name."""

_MINUTE_NS: Final = 60 * SECOND_NS
_STEP_WAIT_NS: Final = 5 * SECOND_NS

_log = logging.getLogger(__name__)


def with_marks(
    outputs: Sequence[Output],
    triggers: Sequence[str],
    folder: OutputFolder,
    command: TriggerCommand | None = None,
) -> Sequence[Output]:
    """Return outputs that also mark when a trigger fires.

    Args:
        outputs: The outputs that write the recording; returned as they are without a trigger.
        triggers: The conditions, as text.
        folder: The folder of the recording, through which the user requests a mark.
        command: The command to run when a trigger fires.

    Raises:
        TriggerError: A text is not a condition.
    """
    if not triggers:
        return outputs
    watchers = {text: parse_trigger(text) for text in triggers}
    for watcher in watchers.values():
        if isinstance(watcher, UserTrigger):
            folder.on_mark_request(watcher.request)
    return (TriggerMarks(outputs, watchers, command=command),)


class TriggerMarks:
    """An output that passes everything to other outputs, and marks there when a trigger fires.

    Args:
        outputs: The other outputs.
        watchers: The triggers, by their texts.
        clock: Detects steps of the clock.
        command: The command to run when a trigger fires.
    """

    def __init__(
        self,
        outputs: Sequence[Output],
        watchers: Mapping[str, Trigger],
        clock: ClockWatch | None = None,
        command: TriggerCommand | None = None,
    ) -> None:
        self._outputs = tuple(outputs)
        self._command = command
        self._watchers = watchers
        self._clock = clock or ClockWatch()
        self._stepped_ns: int | None = None  # elapsed time at the last step
        self._now_ns = 0  # by the clock of the events, which may be later than that of the ticks
        self._had_event = False  # there was an event since the last tick
        self._logged_ns = {trigger: deque[int](maxlen=LOGGED_A_MINUTE) for trigger in watchers}
        self._unlogged: Counter[str] = Counter()

    def write(self, event: WireEvent) -> None:
        """Pass on a raw event."""
        self._had_event = True
        self._now_ns = event.time_ns
        for output in self._outputs:
            output.write(event)
        for trigger, watcher in self._watchers.items():
            self._mark(trigger, watcher.on_event(event))

    def take(self, item: Item, number: int, line: LogLine | None) -> None:
        """Pass on an item derived from the last raw event."""
        for output in self._outputs:
            output.take(item, number, line)
        for trigger, watcher in self._watchers.items():
            self._mark(trigger, watcher.on_item(item))

    def mark(self, time_ns: int, line: LogLine) -> None:
        """Pass on a line of the log."""
        for output in self._outputs:
            output.mark(time_ns, line)

    def tick(self, now_ns: int) -> None:
        """Check time-based triggers, then pass on the tick, which makes the marks durable."""
        if not self._had_event:
            self._now_ns = now_ns
        self._had_event = False
        self._check_clock()
        for trigger, watcher in self._watchers.items():
            self._mark(trigger, watcher.on_time(self._now_ns))
        for output in self._outputs:
            output.tick(now_ns)

    def close(self, summary: Mapping[str, str]) -> None:
        """Pass on the end."""
        for output in self._outputs:
            output.close(summary)
        if self._command:
            self._command.close()

    def _check_clock(self) -> bool:
        """Whether the clock was set, or the machine suspended, recently.

        Events from before may still follow.
        """
        elapsed_ns = self._clock.elapsed_ns()
        if self._clock.step_ns() or self._clock.suspended_ns():
            self._stepped_ns = elapsed_ns
        recent = self._stepped_ns is not None and elapsed_ns - self._stepped_ns < _STEP_WAIT_NS
        if recent:
            for watcher in self._watchers.values():
                watcher.on_clock_step()
        return recent

    def _mark(self, trigger: str, why: str) -> None:
        """Write a mark if there is a reason, and log it unless the log limit is reached."""
        if not why or (self._watchers[trigger].timed and self._check_clock()):
            return
        self.mark(self._now_ns, LogLine(Level.WARN, SOURCE, f"{trigger}: {why}"))
        if self._command:
            self._command.run(trigger, why, self._now_ns)
        logged_ns = self._logged_ns[trigger]
        if len(logged_ns) == LOGGED_A_MINUTE and 0 <= self._now_ns - logged_ns[0] < _MINUTE_NS:
            self._unlogged[trigger] += 1
            return
        logged_ns.append(self._now_ns)
        when = f"{utc_time(self._now_ns):%Y-%m-%dT%H:%M:%S}"
        unlogged = self._unlogged.pop(trigger, 0)
        more = f" ({unlogged} marks before this one were not logged)" if unlogged else ""
        _log.warning("trigger %s at %s UTC: %s%s", trigger, when, why, more)
