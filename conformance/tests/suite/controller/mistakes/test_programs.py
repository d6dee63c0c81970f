"""Faulty controllers: what a node does, and what is left over for the next run.

For each fault, a case of the violated requirement must fail.
"""

import struct
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cached_property
from typing import Any, ClassVar

import pytest

from scaraspec.judge.verdicts import Verdict
from scaraspec.mutants.operators.controller.programs import (
    accepts_errors,
    straightened,
    with_interpreter,
)
from scaraspec.mutants.operators.controller.transfers import SendsAfterTheEnd
from scaraspec.protocol.payloads import Acceptance
from scaraspec.protocol.program_files import (
    Node,
    NodeType,
    Operation,
    Opt,
    Program,
    ProgramError,
    ResultType,
    SetOutput,
    ValueType,
    WaitInput,
    WaitSeconds,
    WaitTimer,
    parse,
)
from scaraspec.virtual_controller import interpreter
from scaraspec.virtual_controller.behaviour.base import ACCEPTED, Silence
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.motion import Motion
from scaraspec.virtual_controller.session import Request, Session

RunCases = Callable[..., Any]


def as_float(value: float) -> float:
    """Round a number to a float of 4 bytes."""
    rounded: float = struct.unpack("f", struct.pack("f", value))[0]
    return rounded


class _KeepsStoppedRun(ControllerCore, ABC):
    """The next run takes over some state of a stopped run."""

    last: interpreter.Run | None = None

    def run_program(self, request: Request) -> Acceptance | Silence:
        reply = super().run_program(request)
        task, last = self.robot.task, self.last
        if reply is ACCEPTED and task is not None and isinstance(task.activity, interpreter.Run):
            self.last = task.activity
            if last is not None and last.outcome is None:
                self.inherit(task.activity, last)
        return reply

    @abstractmethod
    def inherit(self, run: interpreter.Run, last: interpreter.Run) -> None:
        """Copy state of the stopped run to the new one."""


class ContinuesStoppedProgram(_KeepsStoppedRun):
    """A stopped program continues at the same node when it is run again."""

    def inherit(self, run: interpreter.Run, last: interpreter.Run) -> None:
        if last._program == run._program:
            run._index = last._index


class ShortensWaitAfterStop(_KeepsStoppedRun):
    """After a stop, the waits of the next program are half a second shorter."""

    def inherit(self, run: interpreter.Run, last: interpreter.Run) -> None:  # noqa: ARG002 - one signature
        run.next_event_s -= 0.5


class _ReplaceableProgram(interpreter.Run):
    """A run that continues with another program if `latest` is set."""

    latest: ClassVar[Program | None] = None

    def _step(self, now_s: float) -> None:
        if self.latest is not None:
            self._program, type(self).latest = self.latest, None
        super()._step(now_s)


class RunsLatestUpload(SendsAfterTheEnd):
    """A program that is uploaded during a run replaces the running program."""

    interpreter = _ReplaceableProgram

    def uploaded(self, session: Session, name: bytes) -> None:  # noqa: ARG002 - unused
        if self.robot.task is not None:
            _ReplaceableProgram.latest = self.parse_program(self.store.read(name))


class WritesResultEarly(interpreter.Run):
    """Writes operand A into the result variable before it reads operand B."""

    def _compute(self, operation: Operation) -> None:
        if operation.result_type == ResultType.CALCULATION:
            a, _ = self._operands(operation)
            self._variables[operation.result] = a
            operation = replace(operation, value_a_type=ValueType.NUMBER, value_a=a)
        super()._compute(operation)


class _NoNesting(interpreter.Run):
    """Jumps from an IF or ELSE to the next marker of the type of its partner, ignoring nesting."""

    jumps: Sequence[tuple[NodeType, NodeType]] = ()

    def _partner(self) -> int:
        partner, nodes = super()._partner(), self._program.nodes
        jump = nodes[self._index].type, nodes[partner].type
        if jump not in self.jumps:
            return partner
        return next(n for n in range(self._index + 1, len(nodes)) if nodes[n].type is jump[1])


def without_nesting(begin: NodeType, end: NodeType) -> type[ControllerCore]:
    """Return a controller that ignores nesting in jumps from `begin` to `end`."""
    run = type("Run", (_NoNesting,), {"jumps": [(begin, end)]})
    return type(
        f"{begin.name.title()}To{end.name.title()}", (ControllerCore,), {"interpreter": run}
    )


class LoopsToFirstNode(interpreter.Run):
    """Jumps from the end of a loop to the first node of the program."""

    def _repeat(self, start: int) -> None:  # noqa: ARG002 - unused
        self._index = -1


class LoopsToFirstLoop(interpreter.Run):
    """Jumps from the end of a loop to the first loop of the program."""

    def _repeat(self, start: int) -> None:
        kinds = [node.type for node in self._program.nodes]
        super()._repeat(kinds.index(NodeType.LOOP, 0, start + 1))


class IfInElseIsFalse(interpreter.Run):
    """The condition of an IF inside an ELSE is always false."""

    def _holds(self, operation: Operation) -> bool:
        within: list[bool] = []
        for node in self._program.nodes[: self._index]:
            if node.type == NodeType.IF:
                within.append(False)
            elif node.type == NodeType.ELSE:
                within[-1] = True
            elif node.type == NodeType.ENDIF:
                within.pop()
        return not any(within) and super()._holds(operation)


class UsesInitialInputs(interpreter.Run):
    """Operations use the inputs as they were at the start of the program."""

    def __init__(self, *program: Any, **where: Any) -> None:
        super().__init__(*program, **where)
        inputs = self._plant.digital_inputs
        self._first_inputs = {port: int(inputs[port]) for port in range(1, 9)}

    def _value(self, value_type: int, value: int) -> int:
        if value_type == ValueType.INPUT_PORT:
            return self._first_inputs[value]
        return super()._value(value_type, value)


class ComparesByDifference(interpreter.Run):
    """Compares by the sign of a difference that overflows at 32 bits."""

    def _operands(self, operation: Operation) -> tuple[int, int]:
        a, b = super()._operands(operation)
        if operation.opt >= Opt.GREATER:
            return (a - b + 2**31) % 2**32 - 2**31, 0
        return a, b


class ComparesAsFloats(interpreter.Run):
    """Rounds operands to floats of 4 bytes before it compares them."""

    def _operands(self, operation: Operation) -> tuple[int, int]:
        a, b = super()._operands(operation)
        if operation.opt >= Opt.GREATER:
            return round(as_float(a)), round(as_float(b))
        return a, b


class SixteenBitKeys(interpreter.Run):
    """Compares only the lower two bytes of a key, and uses the first variable that matches."""

    def _value(self, kind: int, value: int) -> int:
        if kind == ValueType.VARIABLE:
            value = next(key for key in self._variables if not (key - value) % 2**16)
        return super()._value(kind, value)


class AssignsBytes(interpreter.Run):
    """Truncates assigned values to a signed byte."""

    def _compute(self, operation: Operation) -> None:
        super()._compute(operation)
        if operation.result_type == ResultType.ASSIGNMENT:
            held = self._variables[operation.result]
            self._variables[operation.result] = (held + 2**7) % 2**8 - 2**7


class IgnoresInputAssignments(interpreter.Run):
    """Ignores the assignment of an input."""

    def _compute(self, operation: Operation) -> None:
        no_input = operation.value_a_type != ValueType.INPUT_PORT
        if operation.result_type != ResultType.ASSIGNMENT or no_input:
            super()._compute(operation)


class SetsPortsOnlyToNumbers(interpreter.Run):
    """Sets a port only to a number, not to a variable."""

    def _compute(self, operation: Operation) -> None:
        is_number = operation.value_a_type == ValueType.NUMBER
        if is_number or operation.result_type != ResultType.SET_PORT:
            super()._compute(operation)


class AddsSameVariableOnce(interpreter.Run):
    """Adds 0 if a variable is added to itself."""

    def _operands(self, operation: Operation) -> tuple[int, int]:
        a, b = super()._operands(operation)
        if operation.opt == Opt.ADD and operation.value_a_type == ValueType.VARIABLE:
            same = (ValueType.VARIABLE, operation.value_a)
            return a, 0 if (operation.value_b_type, operation.value_b) == same else b
        return a, b


class MultipliesAsFloats(interpreter.Run):
    """Rounds a product to a float of 4 bytes."""

    def _operands(self, operation: Operation) -> tuple[int, int]:
        a, b = super()._operands(operation)
        return (round(as_float(a * b)), 1) if operation.opt == Opt.MULTIPLY else (a, b)


class StoresUnsignedQuotients(interpreter.Run):
    """Stores a quotient as an unsigned number of 32 bits."""

    def _compute(self, operation: Operation) -> None:
        super()._compute(operation)
        if operation.opt == Opt.DIVIDE and operation.result in self._variables:
            self._variables[operation.result] %= 2**32


class SkipsWaitsAfterIf(interpreter.Run):
    """Does not wait at wait nodes after an IF."""

    def _begin(self, node: Node, now_s: float) -> float:
        before = self._program.nodes[: self._index]
        ends_s = super()._begin(node, now_s)
        hurries = isinstance(node.data, WaitSeconds) and any(n.type == NodeType.IF for n in before)
        return now_s if hurries else ends_s


class IgnoresRepeatedPort(interpreter.Run):
    """Ignores an output node that sets the same port as the previous one."""

    port = 0

    def _set_output(self, output: SetOutput) -> None:
        if output.port != self.port:
            super()._set_output(output)
        self.port = output.port


class AcceptsLoopEndedByEndif(ControllerCore):
    """An ENDIF may end a loop; the loop is then ignored."""

    def parse_program(self, data: bytes) -> Program | None:
        program = super().parse_program(data)
        if program is None:
            with suppress(ProgramError):
                nodes = parse(data).nodes
                if [nodes[0].type, nodes[-1].type] == [NodeType.LOOP, NodeType.ENDIF]:
                    program = replace(parse(data), nodes=nodes[1:-1])
        return program


class LoopInBranchEndsProgram(interpreter.Run):
    """A false IF jumps to the end of the program if its branch contains a loop."""

    def _partner(self) -> int:
        index, partner = self._index, super()._partner()
        nodes = self._program.nodes
        loops = sum(node.type == NodeType.LOOP for node in nodes[index:partner])
        return len(nodes) - 1 if nodes[index].type == NodeType.IF and loops else partner


class CalculatesAsFloats(interpreter.Run):
    """Rounds operands to floats of 4 bytes before it calculates."""

    def _operands(self, operation: Operation) -> tuple[int, int]:
        a, b = super()._operands(operation)
        return (a, b) if operation.opt >= Opt.GREATER else (round(as_float(a)), round(as_float(b)))


class ComparesWithKey(interpreter.Run):
    """Uses the key of a variable instead of its value as the second operand of a comparison."""

    def _operands(self, operation: Operation) -> tuple[int, int]:
        a, b = super()._operands(operation)
        return a, operation.value_b if operation.opt >= Opt.GREATER else b


class RefusesSmallCurveCounts(ControllerCore):
    """Refuses a program with a curve that counts fewer than three points."""

    def parse_program(self, data: bytes) -> Program | None:
        program = super().parse_program(data)
        if program is None:
            return None
        curves = (node for node in parse(data).nodes if node.type == NodeType.CURVE_MOVE)
        return None if any(node.counts < 3 for node in curves) else program


AcceptsTruncatedCurves = type(
    "AcceptsTruncatedCurves",
    (
        RefusesSmallCurveCounts,
        accepts_errors("P-counts-past-end", "P-curve-short", change=straightened),
    ),
    {"__doc__": "A curve with a count of three points may have two if the file ends after them."},
)


class CachesProgramsByName(ControllerCore):
    """Programs are parsed once for each name."""

    def cache_key(self, name: bytes) -> object:
        """Return the key of the cache for a program."""
        return name

    @cached_property
    def programs(self) -> dict[object, Program]:
        return {}

    def _program(self, name: bytes) -> Program | None:
        program = super()._program(name)
        return program and self.programs.setdefault(self.cache_key(name), program)


class CachesProgramsBySum(CachesProgramsByName):
    """Programs are parsed once for each size and sum of bytes."""

    def cache_key(self, name: bytes) -> object:
        content = self.store.read(name)
        return len(content), sum(content)


@pytest.mark.parametrize(
    ("core", "only", "requirement"),
    [
        (without_nesting(NodeType.IF, NodeType.ELSE), "6.5/24", "6.5/24"),
        (without_nesting(NodeType.IF, NodeType.ENDIF), "6.5/24", "6.5/24"),
        (without_nesting(NodeType.ELSE, NodeType.ENDIF), "6.5/24", "6.5/24"),
        (with_interpreter(LoopsToFirstNode), "6.5/23", "6.5/23"),
        (with_interpreter(LoopsToFirstLoop), "6.5/23", "6.5/23"),
        (ShortensWaitAfterStop, "6.5/20", "6.5/20"),
        (CachesProgramsByName, "6.5/19", "6.5/19"),
        (with_interpreter(IgnoresRepeatedPort), "6.5/19", "6.5/19"),
        (CachesProgramsByName, "6.5/24", "6.5/24"),
        (CachesProgramsBySum, "6.6a/13", "6.6a/13"),
        (RunsLatestUpload, "6.5/19", "6.5/19"),
        (with_interpreter(IfInElseIsFalse), "6.5/24", "6.5/24"),
        (ContinuesStoppedProgram, "6.5/26", "6.5/26"),
        (with_interpreter(ComparesByDifference), "6.6a/12", "6.6a/12"),
        (with_interpreter(ComparesAsFloats), "6.6a/12", "6.6a/12"),
        (with_interpreter(MultipliesAsFloats), "6.6a/11", "6.6a/11"),
        (with_interpreter(StoresUnsignedQuotients), "6.6a/11", "6.6a/11"),
        (with_interpreter(AddsSameVariableOnce), "6.6a/14", "6.6a/14"),
        (with_interpreter(SetsPortsOnlyToNumbers), "6.6a/13", "6.6a/13"),
        (with_interpreter(SixteenBitKeys), "6.6a/13", "6.6a/13"),
        (with_interpreter(SkipsWaitsAfterIf), "6.5/20", "6.5/20"),
        (AcceptsLoopEndedByEndif, "6.5/28", "6.5/28"),
        (AcceptsTruncatedCurves, "6.5/28", "6.5/28"),
        (with_interpreter(LoopInBranchEndsProgram), "6.5/24", "6.5/24"),
    ],
)
def test_fault_is_detected(
    run_cases: RunCases, core: type[ControllerCore], only: str, requirement: str
) -> None:
    """One of the cases that run fails for the violated requirement."""
    assert requirement in run_cases(core, only, examples=1, fail_fast=True).violated


@pytest.mark.parametrize(
    ("core", "requirement"),
    [
        (with_interpreter(AssignsBytes), "6.6a/13"),
        (with_interpreter(IgnoresInputAssignments), "6.6a/14"),
        (with_interpreter(CalculatesAsFloats), "6.6a/11"),
        (with_interpreter(ComparesWithKey), "6.6a/14"),
        (with_interpreter(WritesResultEarly), "6.6a/14"),
    ],
)
def test_fault_is_detected_after_a_drawn_program(
    run_cases: RunCases, core: type[ControllerCore], requirement: str
) -> None:
    """A drawn program fails for a general requirement; the case of the fault fails after it."""
    assert requirement in run_cases(core, requirement, examples=1).violated


def test_outdated_inputs_are_detected(run_cases: RunCases) -> None:
    """With a hook that drives inputs, a case detects that a program uses outdated inputs."""
    assert (
        "6.6a/14"
        in run_cases(
            with_interpreter(UsesInitialInputs), "6.5/21", examples=1, hooks=("set_input",)
        ).violated
    )


def test_observation_shows_the_program(run_cases: RunCases) -> None:
    """The observed value contains the program that ran, so that its author sees the cause."""
    failed = run_cases(with_interpreter(IfInElseIsFalse), "6.5/24", examples=1)["6.5/24"]
    assert "of this program: 1 if " in failed.observed
    assert "; 2 set port " in failed.observed


class _GreaterOrEqualVariables(interpreter.Run):
    """Two equal variables are not greater or equal."""

    def _holds(self, operation: Operation) -> bool:
        a, b = self._operands(operation)
        kinds = {operation.value_a_type, operation.value_b_type}
        if operation.opt == Opt.GREATER_OR_EQUAL and kinds == {ValueType.VARIABLE}:
            return a > b
        return super()._holds(operation)


class _RestoresVariables(interpreter.Run):
    """Each iteration of a loop begins with the value of the file in the first of the variables."""

    def _repeat(self, start: int) -> None:
        super()._repeat(start)
        first = self._program.variables[0]
        self._variables[first.key] = first.value


class _PassesLaterTimers(interpreter.Run):
    """A timer that is not the first node does not wait."""

    def _wait_ends_s(self, wait: WaitInput | WaitTimer, now_s: float) -> float:
        passes = isinstance(wait, WaitTimer) and self._index
        return now_s if passes else super()._wait_ends_s(wait, now_s)


class _CutsLaterCurves(interpreter.Run):
    """A curve that is not the first node ends at its second point."""

    def _curve(self, node: Node) -> Motion:
        motion = super()._curve(node)
        if self._index == node.counts:
            return motion
        half = len(motion.waypoints) // 2 + 1
        waypoints, stations_s = motion.waypoints[:half], motion.stations_s[:half]
        return replace(motion, waypoints=waypoints, stations_s=stations_s)


class SimulatesOnceMore(ControllerCore):
    """The run after a simulation is simulated, too."""

    _simulated = False

    def simulate_program(self, request: Request) -> Acceptance:
        self._simulated = True
        return super().simulate_program(request)

    def run_program(self, request: Request) -> Acceptance:
        simulated, self._simulated = self._simulated, False
        return super().simulate_program(request) if simulated else super().run_program(request)


@pytest.mark.parametrize(
    ("core", "case"),
    [
        (with_interpreter(_GreaterOrEqualVariables), "6.5/26.drawn"),
        (with_interpreter(_RestoresVariables), "6.5/23.drawn"),
        (with_interpreter(_PassesLaterTimers), "6.5/26.drawn"),
        (with_interpreter(_CutsLaterCurves), "6.5/27.drawn"),
        (SimulatesOnceMore, "6.5/26.drawn"),
    ],
)
def test_drawn_programs_find_it(run_cases: RunCases, core: type[ControllerCore], case: str) -> None:
    """Random programs find faults that need a rare combination of statements."""
    results = run_cases(core, case.rpartition(".")[0], examples=20)
    assert results[case].verdict is Verdict.FAIL
