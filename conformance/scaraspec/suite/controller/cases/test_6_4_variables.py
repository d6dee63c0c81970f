"""Clause 6.4: user variables and their initial values (L859-872)."""

from collections.abc import Sequence
from typing import Final

from scaraspec.protocol.program_files import Opt
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.ports import outputs, set_output
from scaraspec.suite.engine.case import case
from scaraspec.suite.engine.expectations import CaseSkipped, expect, expect_equal
from scaraspec.suite.program_files.bench import PROGRAMS, Bench, bench
from scaraspec.suite.program_files.model import (
    Assign,
    Calculate,
    Flip,
    If,
    State,
    Statement,
    Wait,
    nodes_of,
    value_checks,
    variables_of,
)
from scaraspec.suite.program_files.writing import OUTPUTS, number, variable

_PASSED, _FAILED = OUTPUTS[0], OUTPUTS[-1]
_WAIT_S: Final = 5
_STOP_S: Final = 1.0
_VALUES: Final = {5: 1, 0: -1, -7: 0, 2_000_000_000: 40_000, 9: 2_147_483_647, 1: -2_147_483_648}
"""Values by key: small and large, of both signs, with keys in no order."""


@case("6.4/5", hazards=PROGRAMS)
def test_initial_values(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Each variable begins with the value of the file, regardless of its key and position."""
    with bench(subject, line) as robot:
        robot.performs([*value_checks(_VALUES, _FAILED), Flip(_PASSED)], _VALUES)


@case("6.4/5", name="many", hazards=PROGRAMS)
def test_many_variables(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """The last of many variables begins with its value, like the first."""
    values = {key: 3 * key - 7 for key in range(40)}
    samples = {key: values[key] for key in (0, 19, 39)}
    with bench(subject, line) as robot:
        robot.performs([*value_checks(samples, _FAILED), Flip(_PASSED)], values, large=True)


@case("6.4/5", "6.5/26", name="again", hazards=PROGRAMS)
def test_initial_values_again(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A second run begins with the values of the file, not with those of the first run.

    It begins with the first node, also if the first run was stopped.
    """
    values = {3: 10, 4: 20}
    block: list[Statement] = [
        If(variable(3), Opt.EQUAL, number(10), [Flip(OUTPUTS[0])], [Flip(OUTPUTS[1])]),
        Calculate(3, variable(3), Opt.ADD, number(1)),
        Assign(4, number(0)),
    ]
    with bench(subject, line) as robot:
        initial = outputs(line)
        name = robot.start(nodes_of(block, initial), variables_of(values))
        robot.finish()
        robot.restart(name)
        robot.finish()
        state = State(initial, (), dict(values))
        state.execute(block)
        message = "the second run of a program differs from the first"
        robot.expect_outputs(state.outputs, state.written, message)
        _expect_restart(line, robot, block, values)


def _expect_restart(
    line: OutgoingConnection, robot: Bench, block: Sequence[Statement], values: dict[int, int]
) -> None:
    """Expect that a program that was stopped does the same when it runs again."""
    initial = outputs(line)
    full_block = [*block, Flip(OUTPUTS[2]), Wait(robot.theirs_s(_WAIT_S))]
    state = State(initial, (), dict(values))
    state.execute(full_block)
    ports = OUTPUTS[:3]
    on = not initial[ports[-1] - 1]
    name = robot.start(nodes_of(full_block, initial), variables_of(values))
    if robot.is_responsive and robot.until(ports[-1], on=on, within_s=_STOP_S):
        robot.stop()
        for port in ports:
            set_output(line, port, on=initial[port - 1])
        robot.restart(name)
        message = "a program that was stopped does not begin with its first node"
        expect(robot.until(ports[-1], on=on, within_s=_WAIT_S), message, requirement="6.5/26")
        message = "a run after one that was stopped differs from the first"
        # The stop may have cleared other outputs.
        reported, expected = (
            [b[port - 1] for port in ports] for b in (outputs(line), state.outputs)
        )
        expect_equal(reported, expected, message)
    robot.stop()


@case("6.4/5", name="simulated", hazards=PROGRAMS)
def test_initial_values_after_a_simulation(
    subject: ControllerUnderTest, line: OutgoingConnection
) -> None:
    """A run begins with the values of the file, not with those of its simulation."""
    block = [*value_checks({3: 10}, _FAILED), Flip(_PASSED), Assign(3, number(11))]
    with bench(subject, line) as robot:
        initial = outputs(line)
        name = robot.store(robot.file(nodes_of(block, initial), variables_of({3: 10})))
        if not robot.ask(name, "simulate_program").accepted:
            raise CaseSkipped("the controller does not simulate such a program")
        robot.ended("simulate_program", within_s=subject.longest_s)
        robot.restart(name)
        robot.finish()
        state = State(initial, (), {3: 10})
        state.execute(block)
        message = "a run after a simulation of its program differs"
        robot.expect_outputs(state.outputs, state.written, message)


@case("6.4/5", name="of-another", hazards=PROGRAMS)
def test_values_of_another_program(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A program begins with its own values, not with those of another program."""
    with bench(subject, line) as robot:
        robot.performs([Assign(1, number(77)), Flip(_PASSED)], {1: 70})
        robot.performs([*value_checks({1: 5, 2: 6}, _FAILED), Flip(_PASSED)], {1: 5, 2: 6})
