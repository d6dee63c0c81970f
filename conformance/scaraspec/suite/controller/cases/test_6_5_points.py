"""Clause 6.5: coordinate nodes and their moves (L904-942).

All moves are steps of one value from the current pose, and back.
"""

from itertools import product
from typing import Final

from hypothesis import Phase, settings
from hypothesis import strategies as st

from scaraspec.judge.tolerances import angle_difference
from scaraspec.protocol.program_files import Opt
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.ports import outputs, readable_inputs
from scaraspec.suite.controller.harness.two_stage.arm import Arm, arm, near
from scaraspec.suite.engine.case import case
from scaraspec.suite.engine.connection import ReceivedFrame
from scaraspec.suite.engine.deadline import Deadline
from scaraspec.suite.engine.examples import examples, given
from scaraspec.suite.engine.expectations import CaseInconclusive, expect
from scaraspec.suite.program_files.bench import PROGRAMS, bench
from scaraspec.suite.program_files.model import (
    Flip,
    Go,
    If,
    State,
    nodes_of,
    value_checks,
    variables_of,
)
from scaraspec.suite.program_files.strategies import DONE, FAILED, SUM, ProgramDealer
from scaraspec.suite.program_files.writing import INPUTS, Values, curve, number, straight, variable
from scaraspec.user_message import UserMessage

_VALUE_INDICES: Final = (3, 2, 1, 0)  # the last one only turns the gripper
_TURNS: Final = 5  # each value, and a curve
_ROUNDS: Final = 5  # of four points, along the longer curve: more than a table of 16 contains
_KINDS: Final = ("calculate", "put", "flip", "branch", "pass")
"""The statements before a drawn move."""
_MIN_OBSERVATIONS: Final = 8
"""Minimum number of observed positions on a path for a statement about it."""
_MANY_POINTS: Final = 20
"""Number of points of a straight move."""
_UNREACHABLE_MM: Final = 1_000_000.0
_START_S: Final = 0.05
_STANDSTILL_S: Final = 0.5
_OBSERVATION_TOLERANCE: Final = 3  # difference between observations of the same path


def _expect_at(robot_arm: Arm, target: Values) -> None:
    position, reached = robot_arm.place_at(target)
    source = "0x3C" if robot_arm.meaning == "joints" else "0x38"
    expect(
        reached,
        UserMessage(
            "after a program, {source} does not report the values of its last point", source=source
        ),
        expected=f"{target}",
        observed=f"{position}",
    )


@case("6.5/27", hazards=PROGRAMS)
def test_point(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A program that ends with a coordinate node ends at its values."""
    with bench(subject, line) as robot, arm(subject, line, robot) as robot_arm:
        axes_done = []
        for index in _VALUE_INDICES:
            for direction in examples((1, -1)):  # a limit may be near
                target = robot_arm.step(robot_arm.home, index, direction)
                back = [] if near(robot_arm.place(), robot_arm.home) else [robot_arm.home]
                if robot_arm.goes(straight(robot_arm.speed_percent, [*back, target])):
                    _expect_at(robot_arm, target)
                    axes_done.append(index)
                    break
        if not axes_done:
            raise CaseInconclusive("the arm cannot make the smallest step in any direction")


@case("6.5/27", name="curve", hazards=PROGRAMS, slow=True)
def test_curve(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A program whose last move is a curve of three or five points ends at its last point."""
    with bench(subject, line) as robot, arm(subject, line, robot) as robot_arm:
        for direction, direction_z in product((1, -1), repeat=2):  # a limit may be near
            corner = robot_arm.step(robot_arm.home, 0, direction)
            last = robot_arm.step(robot_arm.home, 2, direction_z)
            points = [corner, robot_arm.step(corner, 2, direction_z), last]
            if robot_arm.goes(curve(robot_arm.speed_percent, points)):
                _expect_at(robot_arm, last)
                points = [points[1], corner, robot_arm.home, corner, points[1]]
                if robot_arm.goes(curve(robot_arm.speed_percent, points)):
                    _expect_at(robot_arm, points[-1])
                return
    raise CaseInconclusive("the arm cannot move along a small curve at its current pose")


@case("6.5/27", "6.5/24", "6.5/25", "6.5/26", name="drawn", hazards=PROGRAMS)
def test_drawn_moves(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Random programs with a move back along each value, or along curves, end at the last point.

    The moves are in a branch that is executed; the other branch moves back.
    """
    turns: dict[int, int] = {}
    with (
        bench(subject, line) as robot,
        arm(subject, line, robot) as robot_arm,
        readable_inputs(line, INPUTS) as (inputs, ports),
    ):
        dealer = ProgramDealer(inputs, ports)

        @settings(
            max_examples=max(_TURNS, settings().max_examples // 4),
            phases=(Phase.generate,),
        )
        @given(st.integers(0, 2**64))
        def run_and_check(seed: int) -> None:
            turn = turns.setdefault(seed, len(turns))
            moves = _drawn_moves(robot_arm, turn)
            way, back = moves[-1].points[-1], Go(robot_arm.speed_percent, [robot_arm.home])
            program = dealer.program(seed, _KINDS)
            state = State(outputs(line), inputs, dict(program.variables))
            state.execute(program.block)
            result = number(state.variables[SUM])
            branch = If(variable(SUM), Opt.LESS, result, [back], [*moves])
            if turn % 3:
                branch = If(variable(SUM), Opt.EQUAL, result, [*moves], [back])
            checks = value_checks(state.variables, FAILED)
            nodes = nodes_of([*program.block, branch, *checks, Flip(DONE)], state.initial)
            state.execute([Flip(DONE)])
            with robot.with_listing():
                if robot_arm.goes(nodes, variables_of(program.variables)):
                    _expect_at(robot_arm, way)
                    message = "the outputs after a move differ from the result of the statements"
                    robot.expect_outputs(state.outputs, state.written, message)

        run_and_check()


def _drawn_moves(robot_arm: Arm, turn: int) -> list[Go]:
    """Return a move to a step of one value; in every fifth turn, curves of 3 and 21 points."""
    home, speed_percent, index = robot_arm.home, robot_arm.speed_percent, turn % _TURNS
    if index < len(_VALUE_INDICES):
        return [Go(speed_percent, [robot_arm.step(home, _VALUE_INDICES[index], -1)])]
    last = robot_arm.step(home, 2, -1)
    corner = robot_arm.step(home, 0)
    opposite = robot_arm.step(corner, 2, -1)
    return [
        Go(speed_percent, [corner, opposite, last], curved=True),
        Go(speed_percent, [*[opposite, corner, home, corner] * _ROUNDS, opposite], curved=True),
    ]


@case("6.5/27", name="out-of-reach", hazards=PROGRAMS)
def test_out_of_reach(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A program whose point is a kilometer away is refused or fails, and the arm does not move."""
    with bench(subject, line) as robot, arm(subject, line, robot) as robot_arm:
        a, b, _, d = robot_arm.home
        for height_mm in examples((_UNREACHABLE_MM, -_UNREACHABLE_MM)):
            nodes = straight(robot_arm.slow_percent, [(a, b, height_mm, d)])
            reply = robot.ask(robot.store(robot.file(nodes)))
            result = _result_at_rest(subject, line, robot_arm) if reply.accepted else reply
            expect(
                not result.done,
                "a program whose point is out of reach reports success",
                expected="0|05 or 00|05",
                observed=f"{result}",
            )


def _result_at_rest(
    subject: ControllerUnderTest, line: OutgoingConnection, robot_arm: Arm
) -> ReceivedFrame:
    """Wait for the final result of a program that must not move the arm.

    Raises:
        CaseInconclusive: The program moved the arm or did not end, and was stopped.
    """
    deadline = Deadline(subject, subject.longest_s)
    while (result := robot_arm.robot.ended()) is None:
        moved = not near(robot_arm.place(), robot_arm.home)
        if moved or robot_arm.robot.is_overdue(deadline):
            robot_arm.robot.stop()
            raise CaseInconclusive("the program moved the arm, or did not end, and was stopped")
        line.wait(_START_S)
    return result


@case("6.5/25", hazards=PROGRAMS)
def test_straight_move(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A straight move passes all its points in order and ends at the last one."""
    with bench(subject, line) as robot, arm(subject, line, robot) as robot_arm:
        home = robot_arm.home
        first_target, second_target, last = (
            robot_arm.step(home, 3),
            robot_arm.step(home, 3, -1),
            robot_arm.step(home, 3, 0.5),
        )
        for speed_percent in (robot_arm.speed_percent, robot_arm.slow_percent):
            observed = robot_arm.watched(
                straight(speed_percent, [first_target, second_target, last])
            )
            if observed is None or len(observed) >= _MIN_OBSERVATIONS:
                break
        if observed is None:
            raise CaseInconclusive("the arm cannot turn slightly in both directions at its pose")
        position = robot_arm.place()
        expect(
            near(position, last),
            "a straight move does not end at its last point",
            expected=f"{last}",
            observed=f"{position}",
        )
        if len(observed) < _MIN_OBSERVATIONS:  # too fast to observe; compare its duration
            short_move = robot_arm.watched(straight(robot_arm.slow_percent, [second_target])) or []
            expect(
                len(short_move) <= len(observed) + _OBSERVATION_TOLERANCE,
                "a straight move over three points takes less time than a third of it",
                expected=UserMessage("more than {count} observations", count=len(short_move)),
                observed=UserMessage("{count} observations", count=len(observed)),
            )
            return
        angles = [angle_difference(values[3], home[3]) for values in observed]
        step = first_target[3] - home[3]
        peak = next((index for index, angle in enumerate(angles) if angle > step / 2), None)
        expect(
            peak is not None and min(angles[peak:], default=0) < -step / 2,
            "a straight move does not pass all its points",
            expected=UserMessage(
                "beyond {first}, then beyond {second}, then {third}",
                first=f"{step / 2:g}",
                second=f"{-step / 2:g}",
                third=f"{step / 2:g}",
            ),
            observed=UserMessage(
                "from {first} to {last}", first=f"{min(angles):g}", last=f"{max(angles):g}"
            ),
        )


@case("6.5/25", name="moves", hazards=PROGRAMS)
def test_several_moves(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Points belong to the move before them: two moves of two points end at the fourth point.

    A move of many points ends at the last one. The arm does not move after an emergency stop during
    the way back.
    """
    with bench(subject, line) as robot, arm(subject, line, robot) as robot_arm:
        home, speed = robot_arm.home, robot_arm.speed_percent
        points = [robot_arm.step(home, 3, direction) for direction in (1, 0.5, -0.5, -1)]
        if not robot_arm.goes([*straight(speed, points[:2]), *straight(speed, points[2:])]):
            raise CaseInconclusive("the arm cannot turn slightly in both directions at its pose")
        position = robot_arm.place()
        expect(
            near(position, points[-1]),
            "two straight moves do not end at the last point of the second one",
            expected=f"{points[-1]}",
            observed=f"{position}",
        )
        target_poses = [robot_arm.step(home, 3, direction) for direction in (-0.2, 0.2)] * (
            _MANY_POINTS // 2
        )
        robot_arm.goes(straight(speed, [*target_poses, points[0]]))
        position = robot_arm.place()
        expect(
            near(position, points[0]),
            UserMessage(
                "a straight move does not end at the last of {point_count} points",
                point_count=_MANY_POINTS + 1,
            ),
            expected=f"{points[0]}",
            observed=f"{position}",
        )
        robot.start(straight(speed, points[-1:]))
        if robot.is_responsive:
            _expect_standstill(line, robot_arm)
        robot.stop()


def _expect_standstill(line: OutgoingConnection, robot_arm: Arm) -> None:
    """Stop the program that moves the arm, and expect standstill."""
    line.wait(_START_S)
    if not line.ask("emergency_stop").accepted:
        return  # the move may be over
    line.result("emergency_stop")
    position = robot_arm.place()
    line.wait(_STANDSTILL_S)
    later = robot_arm.place()
    expect(
        near(position, later),
        "the arm continues to move although its program was stopped",
        expected=f"{position}",
        observed=f"{later}",
        requirement="4.17/7",
    )
