"""Steps of the clock are detected, and are written into the recording."""

from pathlib import Path
from unittest.mock import Mock

import pytest

from scaraspec.api.auditing import audit
from scaraspec.judge.judge import Judge
from scaraspec.traffic.wire import WireEvent
from scaraspec_recorder.sinks.clock_watch import ClockState, ClockWatch
from scaraspec_recorder.sinks.decoder import Decoder
from scaraspec_recorder.sinks.mcap.mcap_sink import McapSink
from scaraspec_recorder.sinks.text import Level, LogLine
from scaraspec_recorder.units import SECOND_NS


class Clocks:
    """Two clocks with the times 100 s and 0 s."""

    def __init__(self) -> None:
        self.wall_ns = 100 * SECOND_NS
        self.elapsed_ns = 0
        self.awake_ns = 0
        self.read_ns = 0
        self.watch = ClockWatch(lambda: self.wall_ns, self._read, self._read_awake)

    def pass_s(self, seconds: float, step_s: float = 0, asleep_s: float = 0) -> None:
        self.awake_ns += int((seconds - asleep_s) * SECOND_NS)
        self.elapsed_ns += int(seconds * SECOND_NS)
        self.wall_ns += int((seconds + step_s) * SECOND_NS)

    def _read(self) -> int:
        self.elapsed_ns += self.read_ns
        return self.elapsed_ns

    def _read_awake(self) -> int:
        self.awake_ns += self.read_ns
        return self.awake_ns


@pytest.mark.parametrize("step_s", [1, 86_400, -3600])
def test_a_step_is_detected_once(step_s: float) -> None:
    """Also if the clock is set back."""
    clocks = Clocks()
    clocks.pass_s(1000)
    assert clocks.watch.step_ns() == 0
    clocks.pass_s(1000, step_s)
    assert clocks.watch.step_ns() == step_s * SECOND_NS
    assert clocks.watch.step_ns() == 0


def test_observations_of_another_boot_are_not_used() -> None:
    """The elapsed time has started again."""
    clocks = Clocks()
    before = ClockState("another boot", 0, was_set=True)
    watch = ClockWatch(lambda: clocks.wall_ns, lambda: 0, lambda: 0, before=before)
    assert (watch.step_ns(), watch.was_set) == (0, False)


def test_corrections_and_interruptions_are_no_steps() -> None:
    """NTP slews the clock; a stopped process reads the clocks at different times."""
    clocks = Clocks()
    for _ in range(100):
        clocks.pass_s(10, 0.005)
        assert clocks.watch.step_ns() == 0
    clocks.read_ns = 60 * SECOND_NS
    assert clocks.watch.step_ns() == 0
    assert clocks.watch.suspended_ns() == 0


def test_a_suspend_is_logged(caplog: pytest.LogCaptureFixture) -> None:
    """With its length, in the recording and in the log of the recorder; it is no step."""
    clocks, output = Clocks(), Mock()
    decoder = Decoder([output], Judge(), clock=clocks.watch)
    clocks.pass_s(7201.2, asleep_s=7200.3)
    decoder.tick(1)
    decoder.tick(2)
    text = "the machine was suspended for 2 h"
    output.mark.assert_called_once_with(1, LogLine(Level.WARN, "clock", text))
    assert caplog.messages == [text]


def test_a_step_is_logged(caplog: pytest.LogCaptureFixture) -> None:
    """The recording and the log of the recorder have the step."""
    clocks, output = Clocks(), Mock()
    decoder = Decoder([output], Judge(), clock=clocks.watch)
    decoder.tick(1)
    clocks.pass_s(5, 3600)
    decoder.tick(2)
    decoder.tick(3)
    text = "the clock was set forward by 1 h"
    output.mark.assert_called_once_with(2, LogLine(Level.WARN, "clock", text))
    assert caplog.messages == [text]


def test_a_step_is_in_the_audit(tmp_path: Path, shift: list[WireEvent]) -> None:
    """Durations across it are wrong, which the reader must know."""
    clocks, path = Clocks(), tmp_path / "capture.mcap"
    decoder = Decoder([McapSink(path.open("wb"))], Judge(), clock=clocks.watch)
    decoder.write(shift[0])
    clocks.pass_s(5, -90)
    decoder.tick(shift[0].time_ns)
    decoder.close()
    results, notes = audit(path)
    assert notes == ()
    event = "the clock was set back by 90 s at 2026-11-20 22:58:37 UTC"
    (notice,) = results.notices
    assert notice == f"Recorder: {event}. Durations across this time are wrong"
