"""Clause 6.5: nodes that wait: for a duration, for a time, for an input."""

import itertools
import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from typing import Final

from scaraspec.protocol.program_files import Condition, Node, Opt
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.ports import (
    Bits,
    driven_inputs,
    expect_outputs,
    inputs_unchanged,
    outputs,
    stable_inputs,
    with_port,
)
from scaraspec.suite.controller.harness.traits import LayoutTrial
from scaraspec.suite.controller.harness.two_stage.tasks import probe_responsiveness
from scaraspec.suite.engine.case import case
from scaraspec.suite.engine.examples import examples
from scaraspec.suite.engine.expectations import CaseFailed, CaseInconclusive, CaseSkipped, expect
from scaraspec.suite.program_files.bench import EARLY_S, PROGRAMS, Bench, bench
from scaraspec.suite.program_files.layout import TRIAL_S, trial_of, twin_of
from scaraspec.suite.program_files.writing import (
    ANALOG,
    INPUTS,
    OUTPUTS,
    branch,
    compare,
    input_port,
    number,
    set_output,
    wait,
    wait_input,
    wait_until,
)
from scaraspec.user_message import UserMessage

_SLACK_S: Final = 0.5
_SLACK_RATIO: Final = 0.1  # ratio of the seconds; the larger tolerance applies (6.5/20)
_LINK_S: Final = 0.25  # in real time, if the controller's seconds are shorter
_MEASURABLE_S: Final = 2  # of our clock: how long waits of 0 s last if each takes a second
_LONG_S: Final = 200  # negative as a signed byte
_SHORT_WATCH_S: Final = 0.2  # how long a waiting program is observed
_WATCH_S: Final = 0.6  # the same for a single observation
_INPUT_TIMEOUT_S: Final = 3.0  # maximum delay of an input; the document sets no limit
_TIMER_S: Final = 1.0  # the whole second of the clock, or later, before which a timer ends …
_BEFORE_S: Final = 0.25  # … by this
_TICK_TOLERANCE_S: Final = 0.3  # accuracy of the observed clock tick
_UTC_S: Final = 2.0
_HOUR_S: Final = 3600  # the smallest offset of a zone; a fast clock may be ahead of UTC by less
_FAR_S: Final = 2 * 86_400  # more than any two zones differ
_MAX_TIMER: Final = 2**31 - 2 * _FAR_S  # seconds before or after 1970; 4 bytes contain later timers
_POLL_S: Final = 0.06
_TICKS: Final = 30  # more than a second of clock queries
_US_PER_S: Final = 1_000_000
_NS_PER_S: Final = 1e9


# ---------------------------------------------------------------------- seconds


@case("6.5/20", hazards=PROGRAMS)
def test_wait(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A wait node lasts its number of seconds, neither less nor much more.

    The program that determined the layout can show it. Otherwise, another one runs.
    """
    with bench(subject, line) as robot:
        with suppress(CaseFailed):
            _check_duration(subject, robot, trial_of(subject), [TRIAL_S])
            return
        robot.start(wait(TRIAL_S))
        _expect_duration(subject, robot, [TRIAL_S])


@case("6.5/20", name="several", hazards=PROGRAMS, slow=True)
def test_waits(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Several waits add up, including waits of 0 s and one inside an IF.

    A long wait that was stopped before has no effect.
    """
    probe_responsiveness(subject, line)
    with bench(subject, line) as robot:
        robot.start(wait(_LONG_S))
        robot.stop()
        durations_s = [0, 1, 0, 2]
        *nodes, last = (wait(seconds) for seconds in durations_s)
        conditional_wait = branch(compare(number(1), Opt.LESS, number(2)), last)
        robot.start([*itertools.chain.from_iterable(nodes), *conditional_wait])
        _expect_duration(subject, robot, durations_s)


@case("6.5/20", name="none", hazards=PROGRAMS)
def test_wait_of_no_time(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A wait of 0 seconds takes no time."""
    scale = subject.ics.time_scale
    # One second of a fast controller can be shorter than the delays of a link.
    durations_s = [0] * (math.ceil(_MEASURABLE_S * scale) if scale > 1 else 1)
    with bench(subject, line) as robot:
        robot.start(itertools.chain.from_iterable(map(wait, durations_s)))
        _expect_duration(subject, robot, durations_s)


@case("6.5/20", name="long", hazards=PROGRAMS)
def test_long_wait(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A wait of 200 s after one of 0 s does not end immediately; it has no effect after a stop."""
    probe_responsiveness(subject, line)
    with bench(subject, line) as robot:
        robot.start([*wait(0), *wait(_LONG_S)])
        line.wait(robot.ours_s(_WATCH_S))
        result = robot.ended()
        expect(
            result is None,
            UserMessage("a wait of {seconds} s ended immediately", seconds=_LONG_S),
            expected="none",
            observed=f"{result}",
        )
        robot.stop()
        robot.start(wait(0))
        _expect_duration(subject, robot, [0])


def _expect_duration(subject: ControllerUnderTest, robot: Bench, waits: Sequence[int]) -> None:
    """Check the duration of a program that only waits for this many seconds."""
    ended_s = robot.finish(lasts_s=sum(waits)).time_s
    trial = LayoutTrial(robot.started_s, robot.replied_s, ended_s)
    _check_duration(subject, robot, trial, waits)


def _check_duration(
    subject: ControllerUnderTest, robot: Bench, trial: LayoutTrial, waits: Sequence[int]
) -> None:
    """Check the duration; each wait may be late, and the start of a program may take time."""
    seconds, scale = sum(waits), subject.ics.time_scale
    link_s = _LINK_S if scale > 1 else 0.0
    tolerance_s = sum(max(_SLACK_S, _SLACK_RATIO * wait_s) for wait_s in waits)
    longest_s = (seconds + tolerance_s) / scale + link_s
    lasted_s = trial.ended_s - trial.requested_s
    expect(
        lasted_s >= seconds / scale - EARLY_S,
        UserMessage("a wait of {seconds} s is too short", seconds=seconds),
        expected=UserMessage("at least {limit_s} s", limit_s=f"{seconds / scale:g}"),
        observed=f"{lasted_s:.2f} s",
    )
    if trial.ended_s - trial.replied_s > longest_s:
        longest_s += _duration_without_wait_s(robot)
    expect(
        trial.ended_s - trial.replied_s <= longest_s,
        UserMessage("a wait of {seconds} s is too long", seconds=seconds),
        expected=UserMessage("at most {limit_s} s", limit_s=f"{longest_s:g}"),
        observed=f"{lasted_s:.2f} s",
    )


def _duration_without_wait_s(robot: Bench) -> float:
    """Return how long a program lasts that does not wait."""
    output = OUTPUTS[0]
    ended_s = robot.run([set_output(output, on=robot.before[output - 1])]).time_s
    return ended_s - robot.replied_s


# ---------------------------------------------------------------------- timers


@case("6.5/22", hazards=PROGRAMS)
def test_timer(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A timer node waits until its time, which is not a whole second, and not longer.

    If the clock of 0x07 does not show UTC, the meaning of the time is open (A-6.5-13). But no
    program passes a timer that is two days in the future of both clocks.
    """
    with bench(subject, line) as robot:
        clock_s, at_s = _wait_for_clock_tick(subject, line)
        problem = _timer_problem(subject, robot, clock_s, at_s)
        ahead_s = clock_s - at_s
        is_utc = -_UTC_S <= ahead_s <= (_HOUR_S if subject.ics.time_scale > 1 else _UTC_S)
        twin = twin_of(robot.layout)
        if problem and twin:  # differs only in the size of a long, which only a timer shows
            robot.stop()
            robot.layout = twin
            problem = (
                _timer_problem(subject, robot, *_wait_for_clock_tick(subject, line)) and problem
            )
        if not problem or not is_utc:
            robot.stop()
            robot.start([wait_until(round((max(clock_s, at_s) + _FAR_S) * _US_PER_S))])
            _expect_waiting(line, robot, outputs(line), "its timer is in the future")
    if problem and not is_utc:
        subject.tolerate(
            "6.5/22",
            "A-6.5-13",
            "another clock",
            UserMessage("{problem}; but the clock does not show UTC", problem=problem),
        )
    else:
        expect(not problem, problem, expected="11 at the time of the timer", observed=problem)


def _timer_problem(subject: ControllerUnderTest, robot: Bench, clock_s: float, at_s: float) -> str:
    """Run a timer that ends a fixed time after a clock tick; return the problem, or ""."""
    timer_s = robot.theirs_s(_TIMER_S) - _BEFORE_S
    robot.start([wait_until(round((clock_s + timer_s) * _US_PER_S))])
    due_s = at_s + robot.ours_s(timer_s)
    # The time may have come before the start.
    remaining_s = max(due_s - subject.now_ns / _NS_PER_S, 0.0)
    result = robot.ended(within_s=remaining_s + robot.ours_s(_SLACK_S) + _LINK_S)
    if result is None:
        return "a timer is not over at its time"
    if not result.done:
        return UserMessage("a program with a timer failed: {result}", result=result)
    if result.time_s < due_s - _TICK_TOLERANCE_S:
        early_s = due_s - result.time_s
        return UserMessage("a timer is over {early_s:.2f} s too early", early_s=early_s)
    return ""


def _wait_for_clock_tick(
    subject: ControllerUnderTest, line: OutgoingConnection
) -> tuple[float, float]:
    """Wait until the controller's clock shows the next second.

    Returns:
        The clock's time in seconds since 1970, and the time of the tick.

    Raises:
        CaseInconclusive: The clock stands still, is not reported, or does not fit a timer.
    """
    first = line.ask("get_time").value
    for _ in range(_TICKS):
        line.wait(_POLL_S)
        at_s = subject.now_ns / _NS_PER_S
        clock = line.ask("get_time").value
        if isinstance(first, datetime) and isinstance(clock, datetime) and clock > first:
            seconds = clock.replace(tzinfo=UTC).timestamp()
            if abs(seconds) >= _MAX_TIMER:
                raise CaseInconclusive(
                    "the controller's clock shows a time that a timer cannot contain"
                )
            return seconds, at_s
    raise CaseInconclusive("the controller's clock, on which a timer depends, stands still")


# ---------------------------------------------------------------------- inputs

_VALUES: Final = {
    Condition.GREATER: 0,
    Condition.LESS: 1,
    Condition.EQUAL: 0,
    Condition.NOT_GREATER: 0,
    Condition.NOT_LESS: 1,
}
"""For each condition, a value that distinguishes 0 from 1, whether an active digital input counts
as 100 or as 1 (A-6.5-10).
"""


def _is_true(condition: Condition, *, on: bool) -> bool:
    """Whether a digital input of this state meets a condition with its value above."""
    return on == (condition in (Condition.GREATER, Condition.NOT_LESS))


def _conditions() -> Iterator[tuple[Condition, int, bool, bool]]:
    """Yield conditions, their values, the state of an input, and whether it meets them."""
    for condition, value in _VALUES.items():
        for on in (False, True):
            yield condition, value, on, _is_true(condition, on=on)
    for condition in (Condition.LESS, Condition.NOT_LESS):
        yield condition, 0, False, condition is Condition.NOT_LESS
    yield Condition.EQUAL, 1, False, False


def _expect_waiting(
    line: OutgoingConnection,
    robot: Bench,
    expected_outputs: Bits,
    description: str,
    *,
    for_s: float = _WATCH_S,
) -> None:
    """Expect that a program is still waiting after some time."""
    line.wait(robot.ours_s(for_s))
    result = robot.ended()
    expect(
        result is None,
        UserMessage("the program ended although {description}", description=description),
        expected="no final result",
        observed=f"{result}",
    )
    if robot.is_responsive:
        message = UserMessage(
            "the program continued although {description}", description=description
        )
        expect_outputs(line, expected_outputs, message)


@case("6.5/9", "6.5/21", hazards=PROGRAMS)
def test_conditions(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A program passes conditions that the current inputs meet, and waits at the others."""
    with bench(subject, line) as robot:
        _check_conditions(line, robot)


@case("6.5/9", "6.5/21", name="driven", needs=("set_input",), hazards=PROGRAMS, attended=True)
def test_driven_conditions(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A program passes conditions that driven inputs meet, and waits at the others."""
    with bench(subject, line) as robot, driven_inputs(subject, line) as drive:
        drive.set_ports({port: bool(port % 2) for port in INPUTS})
        _check_conditions(line, robot)


def _check_conditions(line: OutgoingConnection, robot: Bench) -> None:
    fulfilled: list[Node] = []
    unchanged_inputs = stable_inputs(line, INPUTS)
    if not unchanged_inputs:
        raise CaseInconclusive("no input is unchanged, so that a program could wait for it")
    with inputs_unchanged(line, unchanged_inputs) as states:
        ports = {states[port - 1]: port for port in unchanged_inputs}
        for condition, value, on, is_true in _conditions():
            if on not in ports:
                continue
            waiting = wait_input(ports[on], condition, value)
            if is_true:
                fulfilled.append(waiting)
                continue
            before = outputs(line)  # a stop may have cleared outputs
            output = set_output(OUTPUTS[0], on=not before[OUTPUTS[0] - 1])
            robot.start([*fulfilled, waiting, output])
            description = UserMessage(
                "input {port} is {on:d} and the condition is {condition} with {value}",
                port=ports[on],
                on=on,
                condition=condition,
                value=value,
            )
            _expect_waiting(line, robot, before, description, for_s=_SHORT_WATCH_S)
            robot.stop()
        robot.run(fulfilled)


@case("6.5/21", "6.5/9", name="goes-on", needs=("set_input",), hazards=PROGRAMS, attended=True)
def test_continues_when_fulfilled(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A program waits until the input meets the condition, for each of the five, and continues."""
    steps = list(zip(_VALUES.items(), INPUTS, OUTPUTS, strict=False))
    with bench(subject, line) as robot, driven_inputs(subject, line) as drive:
        nodes: list[Node] = []
        drive.set_ports(
            {port: not _is_true(condition, on=True) for (condition, _), port, _ in steps}
        )
        for (condition, value), port, output in steps:
            nodes += [
                wait_input(port, condition, value),
                set_output(output, on=not robot.before[output - 1]),
            ]
        robot.start(nodes)
        expected_outputs = robot.before
        for (condition, value), port, output in examples(steps):
            description = UserMessage(
                "input {port} does not meet condition {condition} with {value}",
                port=port,
                condition=condition,
                value=value,
            )
            _expect_waiting(line, robot, expected_outputs, description)
            drive(port, on=not drive.now[port - 1])
            on = not robot.before[output - 1]
            expect(
                robot.until(output, on=on, within_s=_INPUT_TIMEOUT_S),
                UserMessage(
                    "the program still waits although input {port} meets condition {condition}",
                    port=port,
                    condition=condition,
                ),
                expected=UserMessage(
                    "output {port} is set to {value}", port=output, value=f"{on:d}"
                ),
                observed="it is not set",
            )
            expected_outputs = with_port(expected_outputs, output, on=on)
        robot.finish()


@case("6.5/21", name="each-port", needs=("set_input",), hazards=PROGRAMS, attended=True)
def test_waits_for_its_port(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A program waits for the port of its node, and does not continue because of another input.

    An IF after the wait uses the current state of an input, not the one at the start.
    """
    with bench(subject, line) as robot, driven_inputs(subject, line) as drive:
        drive.set_ports(dict.fromkeys(INPUTS, False))
        port_waited_for, output = INPUTS[2], OUTPUTS[0]
        on = not robot.before[output - 1]
        input_is_on = compare(input_port(INPUTS[0]), Opt.GREATER, number(0))
        waiting = wait_input(port_waited_for, Condition.GREATER, 0)
        robot.start([waiting, *branch(input_is_on, [set_output(output, on=on)])])
        drive.set_ports(dict.fromkeys((*INPUTS[:2], *INPUTS[3:]), True))
        description = UserMessage("only inputs other than {port} are on", port=port_waited_for)
        _expect_waiting(line, robot, robot.before, description)
        drive(port_waited_for, on=True)
        robot.finish()
        expected_outputs = with_port(robot.before, output, on=on)
        message = "a program does not use an input that was switched on while it ran"
        expect_outputs(line, expected_outputs, message, requirement="6.6a/14")


@case("6.5/9", name="hundredths", needs=("set_input",), hazards=PROGRAMS, attended=True)
def test_hundredths(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """An active digital input equals 100, or 1 if only analog inputs are scaled (A-6.5-10)."""
    port = INPUTS[0]
    with bench(subject, line) as robot, driven_inputs(subject, line) as drive:
        drive(port, on=True)
        for value, reading in examples(((100, "all"), (1, "analog"))):
            robot.start([wait_input(port, Condition.EQUAL, value)])
            result = robot.ended(within_s=robot.ours_s(_INPUT_TIMEOUT_S))
            if result is not None:
                expect(result.done, "a valid program failed", expected="11", observed=f"{result}")
                subject.set_reading("wait_scale", reading)
                break
            robot.stop()
        else:
            raise CaseFailed(
                "an active digital input equals neither 100 nor 1",
                expected="the program continues",
                observed="the program waits",
            )
    if reading == "analog":
        message = "an active digital input equals 1"
        subject.tolerate("6.5/9", "wait_scale", reading, message)


@case("6.5/9", "6.5/21", name="analog", needs=("set_analog",), hazards=PROGRAMS)
def test_analog_conditions(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """An analog input is compared in hundredths: each condition is tried at and near its limit."""
    steps = (
        (Condition.GREATER, 250, 2.75),
        (Condition.LESS, 275, 2.5),
        (Condition.EQUAL, 275, 2.75),
        (Condition.EQUAL, 225, 2.25),
        (Condition.NOT_LESS, 250, 2.5),
        (Condition.NOT_GREATER, 225, 2.25),
    )
    before = line.ask("get_analog_input", ANALOG).value
    with bench(subject, line) as robot:
        try:
            subject.hook("set_analog", port=ANALOG, value=2.5)
            if line.ask("get_analog_input", ANALOG).value not in (2.5, 250):
                raise CaseSkipped("the unit in which the hook drives analog inputs is unknown")
            waits = [wait_input(ANALOG, condition, value) for condition, value, _ in steps]
            on = not robot.before[OUTPUTS[0] - 1]
            robot.start([set_output(OUTPUTS[0], on=on), *waits])
            robot.until(OUTPUTS[0], on=on, within_s=_INPUT_TIMEOUT_S)  # a start may take time
            expected_outputs = with_port(robot.before, OUTPUTS[0], on=on)
            for condition, value, driven_value in examples(steps):
                description = UserMessage(
                    "the analog input does not meet condition {condition} with {value}",
                    condition=condition,
                    value=value,
                )
                _expect_waiting(line, robot, expected_outputs, description)
                subject.hook("set_analog", port=ANALOG, value=driven_value)
            robot.finish()
        finally:
            subject.hook("set_analog", port=ANALOG, value=before or 0)


def _reported_analog_value(line: OutgoingConnection) -> float:
    """Query the analog input of the programs.

    Raises:
        CaseSkipped: It is not reported.
    """
    value = line.ask("get_analog_input", ANALOG).value
    if value is None:
        raise CaseSkipped("the analog input that a program could wait for is not reported")
    return float(value)


@case("6.5/9", "6.5/21", name="reported-analog", hazards=PROGRAMS)
def test_reported_analog_conditions(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A program passes conditions that the reported analog value meets, and waits at the others.

    The unit of the value is open (A-4.33-1): a hundred times the value is not exceeded in any.
    """
    with bench(subject, line) as robot:
        value = _reported_analog_value(line)
        above = math.ceil(200 * abs(value)) + 100
        equal = (Condition.EQUAL, 0), (Condition.GREATER, 0)
        met, unmet = equal if value == 0 else ((Condition.NOT_LESS, 0), (Condition.LESS, 0))
        waiting = ((Condition.GREATER, above), (Condition.EQUAL, above), unmet)
        for condition, limit in examples(((Condition.NOT_LESS, above), *waiting)):
            before = outputs(line)  # a stop may have cleared outputs
            node = wait_input(ANALOG, condition, limit)
            robot.start([node, set_output(OUTPUTS[0], on=not before[OUTPUTS[0] - 1])])
            description = UserMessage(
                "the analog input is {value:g} and the condition is {condition} with {limit}",
                value=value,
                condition=condition,
                limit=limit,
            )
            with _analog_value_unchanged(line, value):
                _expect_waiting(line, robot, before, description, for_s=_SHORT_WATCH_S)
            robot.stop()
        passed = ((Condition.LESS, above), (Condition.NOT_GREATER, above), met)
        with _analog_value_unchanged(line, value):
            robot.run([wait_input(ANALOG, *each) for each in passed])


@contextmanager
def _analog_value_unchanged(line: OutgoingConnection, value: float) -> Iterator[None]:
    """Let a failure count only if the analog input still has this value.

    Raises:
        CaseInconclusive: It has changed.
    """
    try:
        yield
    except CaseFailed:
        if _reported_analog_value(line) != value:
            raise CaseInconclusive("the analog input has changed during the case") from None
        raise
