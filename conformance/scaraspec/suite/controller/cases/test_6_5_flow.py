"""Clause 6.5: which nodes are executed, in which order: sequence, branches and loops."""

from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from functools import partial
from random import Random
from typing import Final

from hypothesis import Phase, settings
from hypothesis import strategies as st

from scaraspec.protocol.program_files import ByteOrder, Opt
from scaraspec.protocol.transfer import chunks_of
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.malformed.delivery import ask_slowly
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.clock import (
    has_clock,
    read_clock,
    rollover_if_possible,
)
from scaraspec.suite.controller.harness.requests.files import send_chunk
from scaraspec.suite.controller.harness.requests.ports import (
    expect_outputs,
    outputs,
    readable_inputs,
    set_output,
    with_port,
)
from scaraspec.suite.controller.harness.state.preserve import clock_preserved
from scaraspec.suite.controller.harness.two_stage.commands import BRIEFLY_S, SIMULATE
from scaraspec.suite.engine.case import case
from scaraspec.suite.engine.examples import examples, given
from scaraspec.suite.engine.expectations import CaseInconclusive, expect, expect_equal
from scaraspec.suite.program_files.bench import EARLY_S, PROGRAMS, Bench, bench
from scaraspec.suite.program_files.layout import twin_of
from scaraspec.suite.program_files.model import (
    Block,
    Calculate,
    Flip,
    If,
    Put,
    State,
    Statement,
    Until,
    Wait,
    new_state,
    nodes_of,
    value_checks,
    variables_of,
)
from scaraspec.suite.program_files.strategies import (
    DONE,
    FAILED,
    LOOPS,
    DrawnProgram,
    ProgramDealer,
)
from scaraspec.suite.program_files.writing import (
    INPUTS,
    OUTPUTS,
    branch,
    compare,
    loop,
    number,
    variable,
)
from scaraspec.suite.program_files.writing import set_output as output_node
from scaraspec.user_message import UserMessage

_PASSED, _FAILED = OUTPUTS[0], OUTPUTS[-1]
_X: Final = 3
_COUNTER: Final = 9
_SEEDS: Final = st.integers(0, 2**64)
_NO_LEAP_DAY: Final = datetime(2023, 3, 1)  # noqa: DTZ001 - the document names no zone
_TIMER_S: Final = 2.0
_CLOCK_S: Final = 1.25
"""How much sooner a timer may end: the clock shows whole seconds."""
_US: Final = 1e6
_MANY_NODES: Final = 500
"""Number of nodes that does not fit one byte."""
_WAITS: Final = 2  # before the nodes of a loop have the effect of the last iteration
_LATE_S: Final = 5.0
"""How late a loop of a few nodes may be, in seconds of the controller: there is no limit."""


@case("6.5/19", hazards=PROGRAMS)
def test_output_nodes(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """An output node sets only its port to 1 or 0, regardless of the earlier value.

    A second node for the same port in the same program does the same.
    """
    with bench(subject, line) as robot:
        for _ in range(2):
            robot.performs([Flip(port) for port in OUTPUTS])
        current = outputs(line)
        settings_of_ports = [
            (port, on) for port in OUTPUTS for on in (not current[port - 1], current[port - 1])
        ]
        robot.run(output_node(port, on=on) for port, on in settings_of_ports)
        robot.expect_outputs(
            current, OUTPUTS, "a program set each of these outputs and set it back"
        )


@case("6.5/19", "4.32/6", name="one-by-one", hazards=PROGRAMS)
def test_output_node_alone(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A program of one output node sets only its port; 0x43 sets the port back."""
    with bench(subject, line) as robot:
        for port in examples((OUTPUTS[0], OUTPUTS[-1])):
            before = outputs(line)
            on = before[port - 1]
            set_output(line, port, on=on)
            robot.performs([Flip(port)])
            if set_output(line, port, on=on).accepted:
                message = UserMessage(
                    "output {port} was set back after a program changed it", port=port
                )
                expect_outputs(line, before, message, requirement="4.32/6")


@case("6.5/19", "6.5/26", name="in-time", hazards=PROGRAMS, slow=True)
def test_output_node_in_time(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """An output changes when the program reaches its node, neither earlier nor at the end.

    The upload of another program during the run has no effect on it.
    """
    first, second = OUTPUTS[:2]
    with bench(subject, line) as robot:
        pause_s = robot.theirs_s(BRIEFLY_S)
        robot.start(nodes_of([Flip(first), Wait(pause_s), Flip(second)], robot.before))
        on = not robot.before[first - 1]
        expect(
            robot.until(first, on=on, within_s=pause_s / 2),
            UserMessage(
                "output {port} is not set although the program has reached its node", port=first
            ),
            expected=f"{on:d}",
            observed=f"{not on:d}",
        )
        current = outputs(line)
        if robot.since_s() >= robot.ours_s(pause_s):
            raise CaseInconclusive(
                "the outputs were not reported before the program could continue"
            )
        expected_outputs = with_port(robot.before, first, on=on)
        message = "outputs are set before the program reaches their nodes"
        robot.expect_outputs(expected_outputs, (first,), message, reported=current)
        if line.ask("upload_name", data=subject.new_name()).accepted:
            for chunk in chunks_of(robot.file(nodes_of([Flip(first)], robot.before))):
                send_chunk(line, chunk)
        robot.finish(lasts_s=pause_s)
        expected_outputs = with_port(expected_outputs, second, on=not robot.before[second - 1])
        robot.expect_outputs(
            expected_outputs, (first, second), "the outputs differ from those the program set"
        )


@case("6.5/23", "6.5/20", "4.5/6", hazards=PROGRAMS)
def test_loop(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """The nodes of a loop are executed again, and no others.

    Another loop precedes it, in a branch that is not executed. The clock rolls over to a 1 March.
    """
    first, last = OUTPUTS[:2]
    before_loop = Calculate(3, variable(3), Opt.ADD, number(1))
    body: list[Statement] = [
        If(variable(3), Opt.EQUAL, number(2), [Flip(_FAILED)]),
        If(number(1), Opt.EQUAL, number(1), [Flip(OUTPUTS[2])], [Flip(_FAILED)]),
    ]
    for key, port in ((1, first), (2, last)):
        body.append(Calculate(key, variable(key), Opt.ADD, number(1)))
        body.append(If(variable(key), Opt.EQUAL, number(_WAITS + 1), [Flip(port)]))
    with bench(subject, line) as robot, clock_preserved(subject, line):
        nodes = loop(subject.dialect, nodes_of([*body, Wait(1)], robot.before))
        skipped = loop(subject.dialect, nodes_of([Flip(_FAILED)], robot.before))
        condition = compare(number(2), Opt.LESS, number(1))
        nodes = [*nodes_of([before_loop], robot.before), *branch(condition, skipped), *nodes]
        with rollover_if_possible(subject, line, _NO_LEAP_DAY):
            robot.start(nodes, variables_of({1: 0, 2: 0, 3: 0}))
            for port in (first, last):
                expect(
                    robot.until(
                        port, on=not robot.before[port - 1], within_s=_WAITS * (1 + _LATE_S)
                    ),
                    "a node of a loop is not executed the third time",
                    expected=UserMessage("output {port} changes", port=port),
                    observed="it does not change",
                )
        expect(
            robot.since_s() >= robot.ours_s(_WAITS) - EARLY_S,
            "a loop starts again before its wait is over",
            expected=f"{_WAITS} s",
            observed=f"{robot.since_s():.2f} s",
            requirement="6.5/20",
        )
        expect_equal(
            outputs(line)[_FAILED - 1],
            robot.before[_FAILED - 1],
            "nodes before a loop are executed again with it, or a branch of a false condition is",
        )


_BRANCHES: Final[tuple[Block, ...]] = (
    [If(number(1), Opt.LESS, number(2), [Flip(OUTPUTS[0])], [Flip(_FAILED)])],
    [If(number(2), Opt.LESS, number(1), [Flip(_FAILED)], [Flip(OUTPUTS[1])])],
    [If(number(1), Opt.LESS, number(2), [Flip(OUTPUTS[2])])],
    [If(number(2), Opt.LESS, number(1), [Flip(_FAILED)])],
    [
        If(
            number(1),
            Opt.EQUAL,
            number(1),
            [If(number(1), Opt.EQUAL, number(2), [Flip(_FAILED)], [Flip(OUTPUTS[3])])],
            [If(number(1), Opt.EQUAL, number(1), [Flip(_FAILED)], [Flip(_FAILED)]), Flip(_FAILED)],
        )
    ],
    [
        If(
            number(1),
            Opt.GREATER,
            number(1),
            [If(number(1), Opt.EQUAL, number(1), [Flip(_FAILED)]), Flip(_FAILED)],
            [
                Put(OUTPUTS[4], number(0)),
                If(number(1), Opt.EQUAL, number(1), [Flip(OUTPUTS[4])], [Flip(_FAILED)]),
            ],
        )
    ],
    [
        If(
            number(1),
            Opt.GREATER,
            number(1),
            [If(number(1), Opt.EQUAL, number(1), [Flip(_FAILED)], [Flip(_FAILED)]), Flip(_FAILED)],
            [Flip(OUTPUTS[5])],
        )
    ],
    [
        If(
            number(1),
            Opt.GREATER,
            number(1),
            [If(number(1), Opt.EQUAL, number(1), [Flip(_FAILED)]), Flip(_FAILED)],
        )
    ],
)
"""True and false conditions, with ELSE and without, and nested ones."""


@case("6.5/24", hazards=PROGRAMS)
def test_branches(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Only the branch of a true condition is executed, and then the nodes after it."""
    with bench(subject, line) as robot:
        robot.performs([statement for block in _BRANCHES for statement in block])


@case("6.5/24", name="apart", hazards=PROGRAMS)
def test_separate_branches(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Each IF also works in a separate program, which ends with the ENDIF.

    A branch that is not executed may contain a loop.
    """
    with bench(subject, line) as robot:
        for block in _BRANCHES[:4]:
            robot.performs(block)
        current = outputs(line)
        skipped = loop(subject.dialect, nodes_of([Flip(_FAILED)], current))
        condition = compare(number(2), Opt.LESS, number(1))
        robot.run(branch(condition, skipped, nodes_of([Flip(_PASSED)], current)))
        expected_outputs = with_port(current, _PASSED, on=not current[_PASSED - 1])
        message = "an IF whose first branch contains a loop took the wrong branch"
        robot.expect_outputs(expected_outputs, (_PASSED,), message)


@case("6.5/26", hazards=PROGRAMS)
def test_every_node(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Every node up to the last one is executed, in programs of one, two and seven nodes."""
    with bench(subject, line) as robot:
        for count in examples((1, 2, len(OUTPUTS))):
            robot.performs([Flip(port) for port in OUTPUTS[:count]])


@case("6.5/26", name="many", hazards=PROGRAMS)
def test_many_nodes(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Every node is executed in a program with more nodes than one byte can count."""
    with bench(subject, line) as robot:
        fill_nodes = [Calculate(_X, variable(_X), Opt.ADD, number(1))] * _MANY_NODES
        all_executed = If(
            variable(_X), Opt.EQUAL, number(_MANY_NODES), [Flip(_PASSED)], [Flip(_FAILED)]
        )
        robot.performs([Wait(0), *fill_nodes, all_executed], {_X: 0}, large=True)


@case(
    *("6.5/26", "6.4/5", "6.5/19", "6.5/20", "6.5/21", "6.5/24", "6.6a/11", "6.6a/12", "6.6a/13"),
    *("6.6a/14", "6.5/22"),
    name="drawn",
    hazards=PROGRAMS,
)
def test_drawn_programs(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Random programs end with the outputs and variables that the document requires.

    Some are simulated before: they must end with success, and run as usual after it. A program that
    waits has a timer.
    """
    can_simulate = SIMULATE not in subject.ics.unsupported
    with _programs(subject, line) as (robot, dealer):

        @_drawn(share=2)
        @given(seed=_SEEDS, simulated=st.booleans())
        def run_and_check(*, seed: int, simulated: bool) -> None:
            program = dealer.program(seed)
            state = new_state(program.variables, dealer.inputs)
            state.execute(program.block)
            block = [*program.block, *value_checks(state.variables, FAILED)]
            performs = partial(robot.performs, variables=program.variables, inputs=dealer.inputs)
            if state.waited_s:
                with _timer_instead(subject, line, robot, block) as timed:
                    slowly = partial(ask_slowly, subject, Random(seed))  # noqa: S311 - reproducible
                    performs(timed, while_running=slowly)
            else:
                performs(block, simulated=simulated and can_simulate)

        run_and_check()


@contextmanager
def _timer_instead(
    subject: ControllerUnderTest, line: OutgoingConnection, robot: Bench, block: Block
) -> Iterator[Block]:
    """Yield these statements with a timer in place of a wait; require that they last until then.

    Without a clock that shows UTC, the statements are unchanged (A-6.5-13). The timer ends with a
    second: then a long of four bytes and one of eight have the same little-endian bytes.
    """
    clock = read_clock(subject, line) if has_clock(subject) else None
    known = robot.layout.byte_order is ByteOrder.LITTLE or twin_of(robot.layout) is None
    clock_s = clock.time.replace(tzinfo=UTC).timestamp() if clock and known else 0.0
    if not clock or abs(clock_s - clock.answered_s) > _TIMER_S:
        yield block
        return
    timer = Until(round((clock_s + _TIMER_S) * _US))
    yield [timer if isinstance(each, Wait) else each for each in block]
    lasted_s, least_s = robot.ended_s - clock.sent_s, _TIMER_S - _CLOCK_S
    expect(
        lasted_s >= least_s,
        "a program ends before its timer",
        expected=UserMessage("at least {limit_s} s", limit_s=f"{least_s:g}"),
        observed=f"{lasted_s:.2f} s",
        requirement="6.5/22",
    )


@case("6.5/23", "6.5/24", "6.6a/11", "6.6a/12", "6.6a/13", name="drawn", hazards=PROGRAMS)
def test_drawn_loops(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Random programs with a loop set the outputs and variables that the document requires.

    The loop counts its iterations. After the last one, it compares the variables instead of
    executing its statements again.
    """
    with _programs(subject, line) as (robot, dealer):

        @_drawn(share=4)
        @given(_SEEDS)
        def run_and_check(seed: int) -> None:
            program = dealer.loop(seed)
            initial = outputs(line)
            state = State(initial, dealer.inputs, dict(program.variables))
            state.execute([*program.block, *[*program.body] * LOOPS])
            try:
                _expect_loop(subject, robot, program, state)
            finally:
                robot.stop()

        run_and_check()


@contextmanager
def _programs(
    subject: ControllerUnderTest, line: OutgoingConnection
) -> Iterator[tuple[Bench, ProgramDealer]]:
    """Yield a bench and the source of the programs."""
    with bench(subject, line) as robot, readable_inputs(line, INPUTS) as (inputs, ports):
        yield robot, ProgramDealer(inputs, ports)


def _drawn(share: int) -> settings:
    """Return settings for a part of the examples.

    Programs are short, so they are not shrunk: this would take hundreds of runs.
    """
    return settings(max_examples=-(-settings().max_examples // share), phases=(Phase.generate,))


def _expect_loop(
    subject: ControllerUnderTest, robot: Bench, program: DrawnProgram, state: State
) -> None:
    """Run a program with a loop, and compare what it sets with the state after the iterations.

    Raises:
        CaseFailed: An output differs, or the loop does not end its iterations.
    """
    initial = state.initial
    checks: Block = [*value_checks(state.variables, FAILED), Flip(DONE)]
    state.execute([Flip(DONE)])
    iteration: Block = [
        Calculate(_COUNTER, variable(_COUNTER), Opt.ADD, number(1)),
        If(variable(_COUNTER), Opt.LESS_OR_EQUAL, number(LOOPS), program.body, checks),
    ]
    nodes = [*nodes_of(program.block, initial), *robot.loop(nodes_of(iteration, initial))]
    within_s = robot.theirs_s(subject.longest_s)
    with robot.with_listing():
        robot.start(nodes, variables_of({**program.variables, _COUNTER: 0}))
        expect(
            robot.until(DONE, on=not initial[DONE - 1], within_s=within_s),
            "a loop does not count its iterations",
            expected=UserMessage("output {port} changes", port=DONE),
            observed="it does not change",
        )
        message = "the outputs during a loop differ from the result of its statements"
        robot.expect_outputs(state.outputs, state.written, message)
