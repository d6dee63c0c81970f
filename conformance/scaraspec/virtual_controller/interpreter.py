"""The interpreter: runs a user program (clause 6) as a state machine in simulated time.

It defines what each node does and how long it takes. The behaviour decides whether a program may
start, and sends its outcome. The order and the times of all effects depend only on the program and
the plant, not on how often `Run.advance` is called.
"""

import math
import operator
from collections.abc import Callable, Mapping
from typing import TypeVar

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
    Severity,
    Structure,
    ValueType,
    WaitInput,
    WaitSeconds,
    WaitTimer,
    lint,
)
from scaraspec.protocol.program_files.model import SECOND_US
from scaraspec.protocol.readings import Dialect
from scaraspec.virtual_controller.arm import (
    Joints,
    Pose,
    UnreachableError,
    clamp_to_limits,
    inverse,
)
from scaraspec.virtual_controller.motion import Motion, curve, move, straight_line
from scaraspec.virtual_controller.plant import NoSuchPortError, Plant, Ports, Pwm

NODE_TIME_S = 0.001
"""Minimum time of a node, so that a loop without a wait takes time."""
NODES_PER_ADVANCE = 250
"""Maximum number of nodes per call of `Run.advance`; the points of a curve may exceed it."""
BARE_POINT_SPEED_PERCENT = 50
"""Speed of a move to a point outside a move node (A-6.5-7)."""

_T = TypeVar("_T")

_SUCCESS = Outcome(done=True)
_INVALID_ARGUMENT = "05"  # the nearest code for an invalid argument (A-8-4, A-6.6a-4)


def runnable(program: Program, dialect: Dialect) -> bool:
    """Whether a program may start: `lint` finds no error in it (A-4.15-2, 6.5/28).

    If the count of a loop means iterations, it may exceed the number of nodes (A-6.5-5).
    """
    iterations = dialect["loop_iter"] == "counts"
    return not any(
        finding.severity is Severity.ERROR
        and not (
            iterations
            and finding.code == "P-counts-past-end"
            and finding.node is not None
            and program.nodes[finding.node - 1].type == NodeType.LOOP
        )
        for finding in lint(program)
    )


class Run:
    """One run of a program, simulated or real.

    A simulated run takes the same time and has the same failures, but moves and sets nothing
    (A-4.16-1). A real run moves the plant from its current position; to abort it, stop the plant
    and discard the run. The result is undefined for a program that is not `runnable`.

    Attributes:
        outcome: How the run ended; None while it runs.
        next_event_s: When to call `advance`. Infinite while only a change of an input can end a
            wait, and after the end of the run. It can be in the past after a call that reached
            `NODES_PER_ADVANCE`; then call `advance` again. Setting the clock can change it at the
            next call.
    """

    def __init__(
        self, program: Program, dialect: Dialect, plant: Plant, *, simulated: bool, now_s: float
    ) -> None:
        self.outcome: Outcome | None = None
        self.next_event_s = now_s
        self._program = program
        self._dialect = dialect
        self._plant = plant
        self._simulated = simulated
        self._structure = Structure.of(program.nodes)
        self._variables = {variable.key: variable.value for variable in program.variables}
        self._joints = plant.joints(now_s)
        self._index = 0
        self._executed = 0
        self._repeats: dict[int, int] = {}  # remaining iterations by index of the loop's start
        self._wait: WaitInput | WaitTimer | None = None
        self._seen_s = now_s

    def advance(self, now_s: float) -> Outcome | None:
        """Execute the nodes that start by `now_s`; return the outcome if the run has ended.

        Call it at `next_event_s` or later, and after a change of an input, the clock or a fault of
        the plant.
        """
        if self.outcome is None and self._plant.fault_code:
            self._end(Outcome(done=False, code=self._plant.fault_code))
        if self._wait is not None:
            self.next_event_s = self._wait_ends_s(self._wait, now_s)
        limit = self._executed + NODES_PER_ADVANCE
        while self.next_event_s <= now_s and self._executed < limit:
            self._step(self.next_event_s)
        self._seen_s = now_s
        return self.outcome

    def _end(self, outcome: Outcome) -> None:
        self.outcome = outcome
        self.next_event_s = math.inf
        self._wait = None

    def _step(self, now_s: float) -> None:
        """Start the next node; the previous one has ended."""
        self._wait = None
        if self._index >= len(self._program.nodes):
            self._end(_SUCCESS)
            return
        node = self._program.nodes[self._index]
        executed = self._executed
        try:
            ends_s = self._begin(node, now_s)
        except UnreachableError as error:
            self._end(Outcome(done=False, code=error.code))
        except (NoSuchPortError, ZeroDivisionError):
            self._end(Outcome(done=False, code=_INVALID_ARGUMENT))
        else:
            self._index += 1
            self._executed += 1
            self.next_event_s = max(ends_s, now_s + NODE_TIME_S * (self._executed - executed))

    def _begin(self, node: Node, now_s: float) -> float:
        """Start a node and return when it ends; `_index` is then its last node."""
        match node.data:
            case Point() as point:
                return self._move(self._motion_to(point), now_s)
            case WaitSeconds(duration_s):
                return now_s + duration_s
            case WaitInput() | WaitTimer() as wait:
                self._seen_s = now_s
                ends_s = self._wait_ends_s(wait, now_s)
                self._wait = wait if ends_s > now_s else None
                return ends_s
            case SetOutput() as output:
                self._set_output(output)
            case Operation() as operation if node.type == NodeType.IF:
                if not self._holds(operation):
                    self._index = self._partner()
            case Operation() as operation:
                self._compute(operation)
            case None:
                return self._begin_marker(node, now_s)
        return now_s

    # ------------------------------------------------------------------ control flow

    def _begin_marker(self, node: Node, now_s: float) -> float:
        match node.type:
            case NodeType.CURVE_MOVE:
                return self._move(self._curve(node), now_s)
            case NodeType.LOOP if self._dialect["loop_iter"] == "counts":
                self._repeats[self._index] = node.counts - 1
                if not node.counts:
                    self._index = self._partner()
            case NodeType.END_LOOP:
                self._repeat(self._partner())
            case NodeType.ELSE:
                self._index = self._partner()
        return now_s

    def _partner(self) -> int:
        """Return the index of the marker that belongs to the current one."""
        partner = self._structure.partners[self._index]
        assert partner is not None, "runnable programs are balanced"
        return partner

    def _repeat(self, start: int) -> None:
        """Jump to the start of a loop, forever or for its number of iterations (A-6.5-5)."""
        if self._repeats.get(start) == 0:
            return
        if start in self._repeats:
            self._repeats[start] -= 1
        self._index = start

    # ------------------------------------------------------------------ motion

    def _move(self, motion: Motion, now_s: float) -> float:
        if not self._simulated:
            self._plant.start(motion, now_s)
        self._joints = motion.waypoints[-1]
        return now_s + motion.duration_s

    def _motion_to(self, point: Point) -> Motion:
        target = self._target(point, self._joints)
        owner = self._structure.owners[self._index]
        if owner is None:
            return move(self._joints, target, BARE_POINT_SPEED_PERCENT)
        return straight_line(self._joints, target, self._program.nodes[owner].speed_rate)

    def _curve(self, node: Node) -> Motion:
        targets, near = [], self._joints
        for follower in self._program.nodes[self._index + 1 : self._index + 1 + node.counts]:
            assert isinstance(follower.data, Point), "runnable curves have points only"
            near = self._target(follower.data, near)
            targets.append(near)
        self._index += node.counts
        self._executed += node.counts
        return curve(self._joints, targets, node.speed_rate)

    def _target(self, point: Point, near: Joints) -> Joints:
        """Return the joints for a point of the program (A-6.5-2)."""
        if self._dialect["point_meaning"] == "pose":
            return inverse(Pose(*point.values), near)
        return clamp_to_limits(Joints(*point.values))

    # ------------------------------------------------------------------ waits and ports

    def _wait_ends_s(self, wait: WaitInput | WaitTimer, now_s: float) -> float:
        """Return when a wait ends with the current inputs; or infinity (L930-938, A-6.5-10)."""
        match wait:
            case WaitTimer(seconds, microseconds):
                ends_s = self._plant.clock.when_s(seconds + microseconds / SECOND_US)
                return max(ends_s, self._seen_s)  # a clock change is not retroactive
            case WaitInput(port, value, condition):
                state = self._input(port)
                if self._dialect["wait_scale"] == "all" and not self._is_analog(port):
                    state *= 100
                    value = 100 if value == 1 else value  # a digital 1 may be stored as 1
                return now_s if Condition(condition).holds(state, value) else math.inf

    def _is_analog(self, port: int) -> bool:
        """Whether an input port is analog according to the port configuration."""
        ports = self._program.ports
        return 1 <= port <= len(ports) and ports[port - 1] == PortType.ANALOG_INPUT

    def _input(self, port: int) -> int:
        """Return a digital input as 0 or 1, an analog one times 100 (L934, A-6.6a-5)."""
        if self._is_analog(port):
            return round(self._plant.analog_inputs[port] * 100)
        return int(self._plant.digital_inputs[port])

    def _set_output(self, output: SetOutput) -> None:
        if output.type == PortType.PWM_OUTPUT:
            pwm = Pwm(output.value, output.time_base)
            self._set(self._plant.pwm_outputs, output.port, pwm)
        else:
            self._set(self._plant.digital_outputs, output.port, output.value != 0)

    def _set(self, ports: Ports[_T], port: int, value: _T) -> None:
        """Set an output; a simulated run only checks that the port exists."""
        ports[port] = ports[port] if self._simulated else value

    # ------------------------------------------------------------------ operations

    def _value(self, value_type: int, value: int) -> int:
        match value_type:
            case ValueType.VARIABLE:
                return self._variables[value]
            case ValueType.INPUT_PORT:
                return self._input(value)
        return value

    def _operands(self, operation: Operation) -> tuple[int, int]:
        return (
            self._value(operation.value_a_type, operation.value_a),
            self._value(operation.value_b_type, operation.value_b),
        )

    def _holds(self, operation: Operation) -> bool:
        """Whether an IF executes its first branch (L962, A-6.6a-1)."""
        holds = _COMPARISONS[operation.opt](*self._operands(operation))
        inverted = self._dialect["cmp_result"] == "polarity" and operation.result != 0
        return holds != inverted

    def _compute(self, operation: Operation) -> None:
        """Calculate, assign or set a port (L963-965); a comparison has no effect here."""
        if operation.result_type == ResultType.COMPARISON:
            return
        a, b = self._operands(operation)
        # An assignment may contain an expression, unless its operator is ignored (A-6.6a-2).
        ignores_operator = (
            operation.result_type != ResultType.CALCULATION and self._dialect["assign_opt"] == "any"
        )
        if (
            ignores_operator
            or operation.value_b_type == ValueType.NONE
            or operation.opt not in _ARITHMETIC
        ):
            value = a
        else:
            value = _int32(_ARITHMETIC[operation.opt](a, b))
        if operation.result_type == ResultType.SET_PORT:
            self._set(self._plant.digital_outputs, operation.result, value != 0)
        else:
            self._variables[operation.result] = value


def _divide(a: int, b: int) -> int:
    """C division: truncated towards zero.

    Raises:
        ZeroDivisionError: The divisor is zero.
    """
    quotient = abs(a) // abs(b)
    return quotient if (a < 0) == (b < 0) else -quotient


def _int32(value: int) -> int:
    """Wrap the value like a C int32 overflow (A-6.6a-4)."""
    return (value + 2**31) % 2**32 - 2**31


_ARITHMETIC: Mapping[int, Callable[[int, int], int]] = {
    Opt.ADD: operator.add,
    Opt.SUBTRACT: operator.sub,
    Opt.MULTIPLY: operator.mul,
    Opt.DIVIDE: _divide,
}

_COMPARISONS: Mapping[int, Callable[[int, int], bool]] = {
    Opt.GREATER: operator.gt,
    Opt.LESS: operator.lt,
    Opt.EQUAL: operator.eq,
    Opt.GREATER_OR_EQUAL: operator.ge,
    Opt.LESS_OR_EQUAL: operator.le,
}
