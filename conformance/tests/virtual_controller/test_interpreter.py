"""The interpreter: effect and duration of every node, with every relevant reading."""

import math
from collections.abc import Iterable
from datetime import UTC, datetime
from itertools import chain

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from scaraspec.protocol.payloads import Outcome
from scaraspec.protocol.program_files import (
    Condition,
    Node,
    NodeType,
    Operation,
    Opt,
    Point,
    PortType,
    Program,
    ResultType,
    SetOutput,
    ValueType,
    Variable,
    WaitInput,
    WaitSeconds,
    WaitTimer,
)
from scaraspec.protocol.readings import DEFAULT, Dialect
from scaraspec.virtual_controller.arm import HOME, UPPER, Joints, Pose, forward, inverse
from scaraspec.virtual_controller.interpreter import (
    BARE_POINT_SPEED_PERCENT,
    NODE_TIME_S,
    NODES_PER_ADVANCE,
    Run,
    runnable,
)
from scaraspec.virtual_controller.motion import curve, move, straight_line
from scaraspec.virtual_controller.plant import Plant, Pwm

DONE = Outcome(done=True)
EPOCH_S = int(datetime(2014, 12, 22, 14, 30, tzinfo=UTC).timestamp())
TTL, PWM = PortType.DIGITAL_OUTPUT, PortType.PWM_OUTPUT
ANALOG_PORT_2 = (PortType.DIGITAL_INPUT, PortType.ANALOG_INPUT, *[PortType.UNUSED] * 38)


def point(joints: Joints | Pose) -> Node:
    return Node(b"", NodeType.POINT, data=Point((*joints,)))


def mode(kind: NodeType, counts: int, speed: int = 100) -> Node:
    return Node(b"", kind, speed_rate=speed, counts=counts)


def straight_to(*targets: Joints | Pose, speed: int = 100) -> list[Node]:
    return [mode(NodeType.STRAIGHT_MOVE, len(targets), speed), *map(point, targets)]


def curve_to(*targets: Joints, speed: int = 100) -> list[Node]:
    return [mode(NodeType.CURVE_MOVE, len(targets), speed), *map(point, targets)]


def ttl(port: int, value: int = 1) -> Node:
    return Node(b"", NodeType.SET_OUTPUT, data=SetOutput(TTL, port, value))


def pause(duration_s: int) -> Node:
    return Node(b"", NodeType.WAIT_SECONDS, data=WaitSeconds(duration_s))


def wait_input(port: int, value_hundredths: int, condition: int = Condition.EQUAL) -> Node:
    data = WaitInput(port, value_hundredths, condition)
    return Node(b"", NodeType.WAIT_INPUT, data=data)


def timer(seconds: int, microseconds: int = 0) -> Node:
    return Node(b"", NodeType.WAIT_TIMER, data=WaitTimer(seconds, microseconds))


def loop(*body: Node, counts: int | None = None) -> list[Node]:
    start = Node(b"", NodeType.LOOP, counts=len(body) if counts is None else counts)
    return [start, *body, Node(b"", NodeType.END_LOOP)]


def compute(
    result_type: int,
    result: int,
    a: tuple[int, int],
    opt: int = 0,
    b: tuple[int, int] = (ValueType.NONE, 0),
) -> Node:
    return Node(b"", NodeType.COMPUTE, data=Operation(result_type, result, *a, *b, opt))


def number(value: int) -> tuple[int, int]:
    return ValueType.NUMBER, value


def variable(key: int) -> tuple[int, int]:
    return ValueType.VARIABLE, key


def port(number_of_port: int) -> tuple[int, int]:
    return ValueType.INPUT_PORT, number_of_port


def compare(a: tuple[int, int], opt: int, b: tuple[int, int], result: int = 0) -> Node:
    data = Operation(ResultType.COMPARISON, result, *a, *b, opt)
    return Node(b"", NodeType.IF, data=data)


def branch(
    condition: Node, then: Iterable[Node], otherwise: Iterable[Node] | None = None
) -> list[Node]:
    middle = [] if otherwise is None else [Node(b"", NodeType.ELSE), *otherwise]
    return [condition, *then, *middle, Node(b"", NodeType.ENDIF)]


def start(
    plant: Plant,
    *nodes: Node,
    dialect: Dialect = DEFAULT,
    simulated: bool = False,
    ports: tuple[int, ...] = (PortType.UNUSED,) * 40,
    variables: dict[int, int] | None = None,
) -> Run:
    program = Program(
        nodes=nodes,
        ports=ports,
        variables=tuple(Variable(key, b"", value) for key, value in (variables or {}).items()),
    )
    assert runnable(program, dialect)
    return Run(program, dialect, plant, simulated=simulated, now_s=0.0)


def finish(run: Run, until_s: float = 1e4) -> float:
    """Advance a run from event to event, up to `until_s`; return the time of the last event."""
    now_s = 0.0
    while run.next_event_s <= until_s:
        now_s = run.next_event_s
        run.advance(now_s)
    return now_s


def outputs(plant: Plant) -> set[int]:
    """The numbers of the digital outputs that are on."""
    return {number for number, on in enumerate(plant.digital_outputs, start=1) if on}


HOME_JOINTS = inverse(HOME, near=UPPER)
A = inverse(Pose(200, 200, 300, 30), near=UPPER)
B = inverse(Pose(320, 100, 200, -30), near=UPPER)
C = inverse(Pose(250, -150, 220, 0), near=UPPER)


def test_an_empty_program_succeeds_at_once(plant: Plant) -> None:
    """An empty program takes no time."""
    assert start(plant).advance(0.0) == DONE


# ---------------------------------------------------------------------- motion


def test_motion_to_a_point_outside_a_move(plant: Plant) -> None:
    """Outside a move node the arm moves point to point at the default speed (A-6.5-7)."""
    run = start(plant, point(A))
    ends_s = finish(run)
    assert run.outcome == DONE
    assert plant.joints(ends_s) == pytest.approx(A, abs=1e-4)
    motion = move(HOME_JOINTS, A, BARE_POINT_SPEED_PERCENT)
    assert ends_s == pytest.approx(motion.duration_s, abs=1e-4)
    assert plant.joints(ends_s / 2) == pytest.approx(motion.joints_at(ends_s / 2), abs=0.01)


def test_a_straight_move_ends_at_its_last_point(plant: Plant) -> None:
    """Each point in a straight line at the speed of the move node (6.5/25)."""
    run = start(plant, *straight_to(A, B, speed=40))
    first, second = straight_line(HOME_JOINTS, A, 40), straight_line(A, B, 40)
    finish(run, until_s=1.0)
    assert plant.joints(1.0) == pytest.approx(first.joints_at(1.0 - NODE_TIME_S), abs=0.01)
    ends_s = finish(run)
    assert run.outcome == DONE
    assert ends_s == pytest.approx(NODE_TIME_S + first.duration_s + second.duration_s, abs=1e-3)
    assert plant.joints(ends_s) == pytest.approx(B, abs=1e-4)


def test_only_the_counted_points_belong_to_a_move(plant: Plant) -> None:
    """The point after them belongs to no move node (L924)."""
    run = start(plant, *straight_to(A, speed=100), point(B))
    ends_s = finish(run)
    bare = move(A, B, BARE_POINT_SPEED_PERCENT)
    line = straight_line(HOME_JOINTS, A, 100)
    assert ends_s == pytest.approx(NODE_TIME_S + line.duration_s + bare.duration_s, abs=1e-3)


def test_other_nodes_within_a_straight_move_are_executed(plant: Plant) -> None:
    """A wait between two points of a straight move waits (A-6.5-6)."""
    nodes = [mode(NodeType.STRAIGHT_MOVE, 3), point(A), pause(5), point(B)]
    with_pause = finish(start(plant, *nodes))
    without = finish(start(Plant(datetime(2014, 12, 22, tzinfo=UTC), 0.0), *straight_to(A, B)))
    assert with_pause == pytest.approx(without + 5, abs=1e-3)


def test_a_curve_is_one_smooth_motion(plant: Plant) -> None:
    """Through all its points without a stop, then the following nodes are executed (L942)."""
    run = start(plant, *curve_to(A, B, C, speed=50), ttl(3))
    ends_s = finish(run)
    motion = curve(HOME_JOINTS, [A, B, C], 50)
    assert run.outcome == DONE
    assert ends_s == pytest.approx(motion.duration_s + NODE_TIME_S, abs=1e-3)
    assert plant.joints(ends_s) == pytest.approx(C, abs=1e-4)
    assert outputs(plant) == {3}


@pytest.mark.parametrize("meaning", ["joints", "pose"])
def test_both_readings_of_a_point(plant: Plant, meaning: str) -> None:
    """Joint values by default; x, y, z and thetaX in the other reading (6.5/27, A-6.5-2)."""
    dialect = Dialect.of(point_meaning=meaning)
    values = A if meaning == "joints" else forward(A)
    for nodes in ([point(values)], straight_to(values)):
        run = start(plant, *nodes, dialect=dialect)
        ends_s = finish(run)
        assert run.outcome == DONE
        assert plant.joints(ends_s) == pytest.approx(A, abs=1e-3)


@pytest.mark.parametrize(
    ("values", "meaning", "code"),
    [
        (Joints(131, 0, 200, 0), "joints", "06"),
        (Joints(0, 0, 351, 0), "joints", "05"),
        (Pose(401, 0, 200, 0), "pose", "05"),
        (Pose(300, 0, 200, 700), "pose", "06"),
    ],
)
@pytest.mark.parametrize("simulated", [True, False])
def test_a_point_out_of_reach_fails_the_run(
    plant: Plant, values: Joints | Pose, meaning: str, code: str, *, simulated: bool
) -> None:
    """05 or 06, simulated or not, and the nodes after it are not executed."""
    dialect = Dialect.of(point_meaning=meaning)
    run = start(plant, point(values), ttl(1), dialect=dialect, simulated=simulated)
    assert run.advance(0.0) == Outcome(done=False, code=code)
    assert run.next_event_s == math.inf
    assert run.advance(100.0) == run.outcome
    assert plant.joints(100.0) == HOME_JOINTS
    assert outputs(plant) == set()


# ---------------------------------------------------------------------- waits


@pytest.mark.parametrize("duration_s", [0, 1, 255])
def test_duration_of_a_wait(plant: Plant, duration_s: int) -> None:
    """The wait is not shorter, and at most one node time longer (6.5/20)."""
    run = start(plant, pause(duration_s), ttl(1))
    finish(run, until_s=duration_s - 1e-6)
    assert outputs(plant) == set()
    finish(run, until_s=duration_s + NODE_TIME_S)
    assert outputs(plant) == {1}


HOLDS = {  # by condition: for an input less than, equal to and greater than the value
    Condition.GREATER: (False, False, True),
    Condition.LESS: (True, False, False),
    Condition.EQUAL: (False, True, False),
    Condition.NOT_GREATER: (True, True, False),
    Condition.NOT_LESS: (False, True, True),
}


@pytest.mark.parametrize(
    ("condition", "value", "passes"),
    [
        (condition, value, passes)
        for condition, row in HOLDS.items()
        for value, passes in zip((2.49, 2.5, 2.51), row, strict=True)
    ],
)
def test_a_wait_for_an_analog_input_compares_hundredths(
    plant: Plant, condition: Condition, value: float, *, passes: bool
) -> None:
    """Input, condition, value, in the order of L932: 4 is <=, 5 is >= (6.5/9, 6.5/21)."""
    plant.analog_inputs[2] = value
    run = start(plant, wait_input(2, 250, condition), ports=ANALOG_PORT_2)
    finish(run)
    assert run.outcome == (DONE if passes else None)
    assert run.next_event_s == math.inf


@pytest.mark.parametrize(
    ("scale", "value", "passes"),
    [("all", 1, True), ("all", 100, True), ("analog", 1, True), ("analog", 100, False)],
)
def test_both_readings_of_a_wait_for_a_digital_input(
    plant: Plant, scale: str, value: int, *, passes: bool
) -> None:
    """An input that is on equals 100 and 1 in one reading, only 1 in the other (A-6.5-10)."""
    plant.digital_inputs[7] = True
    run = start(plant, wait_input(7, value), dialect=Dialect.of(wait_scale=scale))
    finish(run)
    assert run.outcome == (DONE if passes else None)


def test_a_wait_for_an_input_ends_when_it_changes(plant: Plant) -> None:
    """The program waits while the condition is false, and continues as soon as it is true."""
    run = start(plant, wait_input(1, 100), point(A))
    run.advance(0.0)
    run.advance(50.0)
    assert run.next_event_s == math.inf
    plant.digital_inputs[1] = True
    run.advance(60.0)
    assert plant.joints(60.0) == HOME_JOINTS
    assert plant.motion_ends_s > 60.0
    plant.digital_inputs[1] = False
    finish(run)
    assert run.outcome == DONE
    assert plant.joints(100.0) == pytest.approx(A, abs=1e-4)


def test_a_timer_waits_for_its_time(plant: Plant) -> None:
    """Seconds and microseconds since 1970 on the robot's own clock (6.5/22)."""
    run = start(plant, timer(EPOCH_S + 10, 500_000))
    run.advance(0.0)
    assert run.next_event_s == pytest.approx(10.5, abs=1e-5)
    assert finish(run) == pytest.approx(10.5, abs=1e-5)
    assert run.outcome == DONE


def test_a_timer_with_a_past_time_does_not_wait(plant: Plant) -> None:
    """A duration in place of a time of day is a time in 1970 (A-6.5-13)."""
    run = start(plant, timer(5))
    assert finish(run) == pytest.approx(NODE_TIME_S)
    assert run.outcome == DONE


@pytest.mark.parametrize(("shift_s", "expected_s"), [(-5, 15), (4, 6), (60, 3)])
def test_setting_the_clock_moves_a_timer(plant: Plant, shift_s: int, expected_s: float) -> None:
    """The timer follows the robot's clock, which 0x06 may set during a run (A-4.5-2)."""
    run = start(plant, timer(EPOCH_S + 10))
    run.advance(3.0)
    time = datetime.fromtimestamp(EPOCH_S + 3 + shift_s, tz=UTC).replace(tzinfo=None)
    plant.clock.set(time, 3.0)
    run.advance(3.0)
    assert max(3.0, finish(run)) == pytest.approx(expected_s, abs=1e-5)
    assert run.outcome == DONE


# ---------------------------------------------------------------------- outputs


def test_outputs_are_set_when_they_are_reached(plant: Plant) -> None:
    """Digital and PWM outputs keep their values (6.5/19)."""
    pwm = Node(b"", NodeType.SET_OUTPUT, data=SetOutput(PWM, 2, 75, 1000))
    run = start(plant, ttl(16), ttl(1), ttl(1, 0), pwm, pause(1), ttl(5))
    finish(run, until_s=0.5)
    assert outputs(plant) == {16}
    assert plant.pwm_outputs[2] == Pwm(75, 1000)
    finish(run)
    assert outputs(plant) == {5, 16}


@pytest.mark.parametrize(
    "node",
    [
        ttl(0),
        ttl(17),
        wait_input(9, 100),
        wait_input(0, 100),
        compute(ResultType.SET_PORT, 40, number(1)),
        compute(ResultType.ASSIGNMENT, 1, (ValueType.INPUT_PORT, 9)),
        Node(b"", NodeType.SET_OUTPUT, data=SetOutput(PWM, 40, 1, 1)),
    ],
)
@pytest.mark.parametrize("simulated", [True, False])
def test_an_unknown_port_fails_the_run(plant: Plant, node: Node, *, simulated: bool) -> None:
    """05 is the nearest code for an invalid argument (A-8-4)."""
    run = start(plant, node, variables={1: 0}, simulated=simulated)
    assert run.advance(0.0) == Outcome(done=False, code="05")


# ---------------------------------------------------------------------- loops and branches


def test_a_loop_repeats_until_the_run_is_interrupted(plant: Plant) -> None:
    """Endless in the default reading; the nodes after it are never executed (A-6.5-5)."""
    count = compute(ResultType.CALCULATION, 1, variable(1), Opt.ADD, number(1))
    run = start(plant, *loop(count, pause(1)), ttl(1), variables={1: 0})
    finish(run, until_s=100)
    assert run.outcome is None
    assert outputs(plant) == set()
    assert 90 < run._variables[1] < 101


@pytest.mark.parametrize("times", [0, 1, 3])
def test_a_loop_may_count_its_iterations(plant: Plant, times: int) -> None:
    """In the other reading the count is the number of iterations, also for an inner loop."""
    count = compute(ResultType.CALCULATION, 1, variable(1), Opt.ADD, number(1))
    inner = loop(count, counts=2)
    dialect = Dialect.of(loop_iter="counts")
    run = start(plant, *loop(*inner, counts=times), ttl(1), variables={1: 0}, dialect=dialect)
    finish(run)
    assert run.outcome == DONE
    assert run._variables[1] == 2 * times
    assert outputs(plant) == {1}


COMPARED = {  # by operator: for A less than, equal to and greater than B
    Opt.GREATER: (False, False, True),
    Opt.LESS: (True, False, False),
    Opt.EQUAL: (False, True, False),
    Opt.GREATER_OR_EQUAL: (False, True, True),
    Opt.LESS_OR_EQUAL: (True, True, False),
}


@pytest.mark.parametrize(
    ("opt", "a", "holds"),
    [
        (opt, a, holds)
        for opt, row in COMPARED.items()
        for a, holds in zip((-8, -7, -6), row, strict=True)
    ],
)
@pytest.mark.parametrize("with_else", [True, False])
def test_exactly_one_branch_is_executed(
    plant: Plant, opt: Opt, a: int, *, holds: bool, with_else: bool
) -> None:
    """Operators 5 to 9 in the order of L982-986: 8 is >=, 9 is <= (6.5/24, 6.6a/12)."""
    nodes = branch(compare(number(a), opt, number(-7)), [ttl(1)], [ttl(2)] if with_else else None)
    run = start(plant, *nodes, ttl(3))
    finish(run)
    assert run.outcome == DONE
    assert outputs(plant) == {3, 1} if holds else ({3, 2} if with_else else {3})


@pytest.mark.parametrize(
    ("reading", "result", "taken"),
    [("output", 0, 1), ("output", 5, 1), ("polarity", 0, 1), ("polarity", 5, 2)],
)
def test_the_result_of_a_comparison_may_invert_it(
    plant: Plant, reading: str, result: int, taken: int
) -> None:
    """Only in the reading in which the result is the expected outcome (A-6.6a-1)."""
    nodes = branch(compare(number(1), Opt.EQUAL, number(1), result), [ttl(1)], [ttl(2)])
    finish(start(plant, *nodes, dialect=Dialect.of(cmp_result=reading)))
    assert outputs(plant) == {taken}


def test_loops_and_branches_nest(plant: Plant) -> None:
    """A loop in a branch in a loop: each ends only at its own end node."""
    count = compute(ResultType.CALCULATION, 1, variable(1), Opt.ADD, number(1))
    few = compare(variable(1), Opt.LESS, number(2))
    inner = branch(few, loop(count, ttl(1), counts=2), [ttl(2), ttl(1, 0)])
    run = start(
        plant,
        *loop(*inner, counts=3),
        ttl(3),
        variables={1: 0},
        dialect=Dialect.of(loop_iter="counts"),
    )
    finish(run)
    assert run.outcome == DONE
    assert run._variables[1] == 2
    assert outputs(plant) == {2, 3}


# ---------------------------------------------------------------------- operations


@pytest.mark.parametrize(
    ("a", "opt", "b", "result"),
    [
        (7, Opt.ADD, -3, 4),
        (7, Opt.SUBTRACT, 9, -2),
        (-7, Opt.MULTIPLY, 3, -21),
        (7, Opt.DIVIDE, 2, 3),
        (-7, Opt.DIVIDE, 2, -3),
        (7, Opt.DIVIDE, -2, -3),
        (-7, Opt.DIVIDE, -2, 3),
        (2**31 - 1, Opt.ADD, 1, -(2**31)),
        (-(2**31), Opt.SUBTRACT, 1, 2**31 - 1),
        (2**16, Opt.MULTIPLY, 2**16, 0),
        (-(2**31), Opt.DIVIDE, -1, -(2**31)),
    ],
)
def test_arithmetic_is_that_of_int32(plant: Plant, a: int, opt: Opt, b: int, result: int) -> None:
    """Truncation towards zero and wrapping, as in C (6.6a/11, A-6.6a-4)."""
    node = compute(ResultType.CALCULATION, 2, variable(1), opt, number(b))
    run = start(plant, node, variables={1: a, 2: 99})
    finish(run)
    assert run._variables == {1: a, 2: result}


@pytest.mark.parametrize("simulated", [True, False])
def test_a_division_by_zero_fails_the_run(plant: Plant, *, simulated: bool) -> None:
    """The final result is 00|05 (A-6.6a-4)."""
    node = compute(ResultType.CALCULATION, 1, number(1), Opt.DIVIDE, variable(1))
    run = start(plant, pause(1), node, ttl(1), variables={1: 0}, simulated=simulated)
    assert finish(run) == pytest.approx(1)
    assert run.outcome == Outcome(done=False, code="05")
    assert outputs(plant) == set()


@pytest.mark.parametrize(
    ("reading", "opt", "b", "result"),
    [
        ("zero", 0, (ValueType.NONE, 0), 6),
        ("zero", Opt.DIVIDE, number(3), 2),
        ("zero", Opt.LESS, number(3), 6),
        ("any", Opt.DIVIDE, number(3), 6),
        ("any", Opt.DIVIDE, number(0), 6),
        ("expression", Opt.DIVIDE, number(3), 2),
        ("expression", Opt.ADD, (ValueType.NONE, 0), 6),
    ],
)
def test_an_assignment_may_contain_an_expression(
    plant: Plant, reading: str, opt: int, b: tuple[int, int], result: int
) -> None:
    """Value A alone, or A opt B if B is present and the reading uses it (A-6.6a-2)."""
    node = compute(ResultType.ASSIGNMENT, 1, number(6), opt, b)
    run = start(plant, node, variables={1: 0}, dialect=Dialect.of(assign_opt=reading))
    finish(run)
    assert run._variables[1] == result


def test_values_come_from_numbers_variables_and_inputs(plant: Plant) -> None:
    """Analog inputs count in hundredths; digital inputs are 0 or 1 (6.6a/14, A-6.6a-5)."""
    plant.digital_inputs[1] = True
    plant.analog_inputs[2] = -1.25
    run = start(
        plant,
        compute(ResultType.ASSIGNMENT, 10, port(1)),
        compute(ResultType.ASSIGNMENT, 11, port(2)),
        compute(ResultType.ASSIGNMENT, 12, variable(-5)),
        compute(ResultType.SET_PORT, 4, port(1)),
        compute(ResultType.SET_PORT, 5, number(0)),
        compute(ResultType.COMPARISON, 0, number(1), Opt.EQUAL, number(1)),
        ports=ANALOG_PORT_2,
        variables={10: 0, 11: 0, 12: 0, -5: 42},
    )
    finish(run)
    assert run.outcome == DONE
    assert run._variables == {10: 1, 11: -125, 12: 42, -5: 42}
    assert outputs(plant) == {4}


def test_a_run_starts_with_the_variables_of_the_file(plant: Plant) -> None:
    """Values that a run calculated are not kept for the next run (6.4/5)."""
    node = compute(ResultType.CALCULATION, 1, variable(1), Opt.ADD, number(1))
    for _ in range(2):
        run = start(plant, node, variables={1: 5})
        finish(run)
        assert run._variables[1] == 6


# ---------------------------------------------------------------------- complete runs


def test_a_simulated_run_has_the_real_duration_and_no_effect(plant: Plant) -> None:
    """No motion and no outputs, but the duration of the real run (A-4.16-1)."""
    pwm = Node(b"", NodeType.SET_OUTPUT, data=SetOutput(PWM, 2, 75, 1000))
    nodes = [
        *straight_to(A, B),
        *curve_to(A, B, C),
        point(A),
        ttl(1),
        pwm,
        compute(ResultType.SET_PORT, 4, number(1)),
        pause(2),
    ]
    simulated_s = finish(start(plant, *nodes, simulated=True))
    assert plant.joints(simulated_s / 2) == plant.joints(simulated_s) == HOME_JOINTS
    assert outputs(plant) == set()
    assert plant.pwm_outputs[2] == Pwm(0, 0)
    assert finish(start(plant, *nodes)) == simulated_s > 5


@pytest.mark.parametrize("simulated", [True, False])
def test_a_fault_of_the_plant_fails_the_run(plant: Plant, *, simulated: bool) -> None:
    """The run fails with the code of the fault, at the next call (L328)."""
    run = start(plant, pause(10), ttl(1), simulated=simulated)
    run.advance(1.0)
    plant.fail("12", 2.0)
    assert run.advance(2.0) == Outcome(done=False, code="12")
    assert run.advance(20.0) == run.outcome
    assert outputs(plant) == set()


def test_a_busy_loop_takes_time_and_never_hangs(plant: Plant) -> None:
    """A node takes at least a millisecond, and one call executes a limited number of nodes."""
    count = compute(ResultType.CALCULATION, 1, variable(1), Opt.ADD, number(1))
    run = start(plant, *loop(count), variables={1: 0})
    run.advance(1e6)
    assert run.next_event_s == pytest.approx(NODES_PER_ADVANCE * NODE_TIME_S)
    assert run._variables[1] == NODES_PER_ADVANCE // 2
    empty = start(plant, *loop())
    empty.advance(0.0105)
    assert empty.next_event_s == pytest.approx(0.011)
    idle_curve = start(plant, *curve_to(*[HOME_JOINTS] * 255))
    idle_curve.advance(0.0)
    assert idle_curve.next_event_s == pytest.approx(256 * NODE_TIME_S)


@pytest.mark.parametrize(
    "nodes",
    [
        [Node(b"", NodeType.LOOP)],
        [Node(b"", NodeType.ELSE)],
        curve_to(A, B),
        [Node(b"", 14)],
        [compute(ResultType.ASSIGNMENT, 1, number(1))],
        straight_to(A, speed=0),
    ],
)
def test_a_program_with_errors_is_not_runnable(nodes: list[Node]) -> None:
    """Unbalanced markers, short curves, unknown nodes and keys, no speed (6.5/28)."""
    assert not runnable(Program(nodes=tuple(nodes)), DEFAULT)


def test_a_number_of_iterations_may_exceed_the_nodes() -> None:
    """A count of 200 is too large for the nodes of a body, but valid as a number of iterations
    (A-6.5-5)."""
    program = Program(nodes=tuple(loop(pause(1), counts=200)))
    assert not runnable(program, DEFAULT)
    assert runnable(program, Dialect.of(loop_iter="counts"))
    move_past_end = Program(nodes=(mode(NodeType.STRAIGHT_MOVE, 2), point(A)))
    assert not runnable(move_past_end, Dialect.of(loop_iter="counts"))


# ---------------------------------------------------------------------- any program

VALUES = st.one_of(
    st.tuples(st.just(ValueType.NUMBER), st.integers(-3, 3) | st.integers(-(2**31), 2**31 - 1)),
    st.tuples(st.just(ValueType.VARIABLE), st.integers(1, 3)),
    st.tuples(st.just(ValueType.INPUT_PORT), st.integers(0, 10)),
)
POINTS = st.builds(
    lambda *values: point(Joints(*values)),
    st.floats(-140, 140, width=32),
    st.floats(-150, 150, width=32),
    st.floats(140, 360, width=32),
    st.floats(-400, 400, width=32),
)
EASY_POINTS = st.sampled_from([A, B, C]).map(point)
TIMES = st.integers(0, 3)
CONDITIONS = st.builds(compare, VALUES, st.integers(5, 9), VALUES, st.integers(0, 1))
STEPS = st.one_of(
    EASY_POINTS,
    POINTS,
    st.builds(pause, st.integers(0, 3)),
    st.builds(ttl, st.integers(0, 18), st.integers(0, 1)),
    st.builds(timer, st.integers(EPOCH_S - 5, EPOCH_S + 20), st.integers(0, 999_999)),
    st.builds(wait_input, st.integers(0, 9), st.sampled_from([0, 1, 100]), st.integers(1, 5)),
    st.builds(
        compute,
        st.sampled_from([ResultType.CALCULATION]),
        st.integers(1, 3),
        VALUES,
        st.integers(1, 4),
        VALUES,
    ),
    st.builds(compute, st.just(ResultType.ASSIGNMENT), st.integers(1, 3), VALUES),
    st.builds(compute, st.just(ResultType.SET_PORT), st.integers(1, 16), VALUES),
).map(lambda node: [node])
MOVES = st.builds(
    lambda kind, points, speed: [mode(kind, len(points), speed), *points],
    st.sampled_from([NodeType.STRAIGHT_MOVE, NodeType.CURVE_MOVE]),
    st.lists(EASY_POINTS | POINTS, min_size=3, max_size=5),
    st.integers(1, 100),
)


def sequences(blocks: st.SearchStrategy[list[Node]]) -> st.SearchStrategy[list[Node]]:
    return st.lists(blocks, max_size=4).map(lambda parts: list(chain.from_iterable(parts)))


BLOCKS = st.recursive(
    STEPS | MOVES,
    lambda blocks: st.one_of(
        st.builds(lambda body, counts: loop(*body, counts=counts), sequences(blocks), TIMES),
        st.builds(branch, CONDITIONS, sequences(blocks), st.none() | sequences(blocks)),
    ),
    max_leaves=8,
)
PROGRAMS = sequences(BLOCKS).map(
    lambda nodes: Program(
        nodes=tuple(nodes),
        ports=ANALOG_PORT_2,
        variables=tuple(Variable(key, b"") for key in (1, 2, 3)),
    )
)
DIALECTS = st.builds(
    Dialect.of,
    loop_iter=st.sampled_from(["counts", "endless"]),
    point_meaning=st.sampled_from(["joints", "pose"]),
    wait_scale=st.sampled_from(["all", "analog"]),
    cmp_result=st.sampled_from(["output", "polarity"]),
    assign_opt=st.sampled_from(["zero", "any", "expression"]),
)
INSTANTS = st.lists(st.floats(0, 10), min_size=1, max_size=12).map(sorted)


def new_plant() -> Plant:
    return Plant(datetime(2014, 12, 22, 14, 30, tzinfo=UTC), now_s=0.0)


@given(program=PROGRAMS, dialect=DIALECTS, instants=INSTANTS, simulated=st.booleans())
def test_the_times_of_calls_do_not_affect_a_run(
    program: Program, dialect: Dialect, instants: list[float], *, simulated: bool
) -> None:
    """No program raises an exception, and its effect does not depend on the times of the calls."""
    assume(runnable(program, dialect))
    coarse, fine = new_plant(), new_plant()
    coarse_run = Run(program, dialect, coarse, simulated=simulated, now_s=0.0)
    fine_run = Run(program, dialect, fine, simulated=simulated, now_s=0.0)
    for now_s in instants:
        while coarse_run.next_event_s <= now_s:
            coarse_run.advance(now_s)
        finish(fine_run, until_s=now_s)
        assert coarse_run.outcome == fine_run.outcome
        assert coarse.joints(now_s) == fine.joints(now_s)
        assert outputs(coarse) == outputs(fine)
    if fine_run.outcome and not fine_run.outcome.done:
        assert fine_run.outcome.code in {"05", "06"}
