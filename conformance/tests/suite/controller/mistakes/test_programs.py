"""Mistakes of other hands in programs: what a node does, and what is left for the next run.

Each is found by a case of a requirement that it violates.
"""

import struct
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cached_property
from typing import Any, ClassVar

import pytest

from scaraspec.mutants.controller.clause_6_5_damaged import TakesShortCurves
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
    WaitSeconds,
    parse,
)
from scaraspec.virtual_controller.behaviour.base import ACCEPTED, Silence
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.interpreter import Run
from scaraspec.virtual_controller.session import Request, Session

Try = Callable[..., Any]


def single(value: float) -> float:
    """The number that a float of 4 bytes has for it."""
    held: float = struct.unpack("f", struct.pack("f", value))[0]
    return held


class _Remembers(ControllerCore, ABC):
    """A program that was stopped has left something to the next one."""

    last: Run | None = None

    def run_program(self, request: Request) -> Acceptance | Silence:
        """Hand it over."""
        answer = super().run_program(request)
        task, last = self.robot.task, self.last
        if answer is ACCEPTED and task is not None and isinstance(task.activity, Run):
            self.last = task.activity
            if last is not None and last.outcome is None:
                self.inherit(task.activity, last)
        return answer

    @abstractmethod
    def inherit(self, run: Run, last: Run) -> None:
        """What a run has of the one that was stopped."""


class GoesOn(_Remembers):
    """A program that was stopped goes on from there when it is run again."""

    def inherit(self, run: Run, last: Run) -> None:
        """Begin where it was."""
        if last._program == run._program:
            run._index = last._index


class WaitsOn(_Remembers):
    """A program behind one that was stopped has half a second of its waits behind it already."""

    def inherit(self, run: Run, last: Run) -> None:  # noqa: ARG002 - one signature
        """Begin earlier."""
        run.next_event_s -= 0.5


class _OneBuffer(Run):
    """What was sent last is what runs on."""

    latest: ClassVar[Program | None] = None

    def _step(self, now_s: float) -> None:
        if self.latest is not None:
            self._program, type(self).latest = self.latest, None
        super()._step(now_s)


class RunsWhatComes(SendsAfterTheEnd):
    """A program that is sent while another one runs takes its place in memory."""

    interpreter = _OneBuffer

    def uploaded(self, session: Session, name: bytes) -> None:  # noqa: ARG002 - whoever sends it
        """Let it."""
        if self.robot.task is not None:
            _OneBuffer.latest = self.parse_program(self.store.read(name))


class _InPlace(Run):
    """Writes A into the result before it looks at B."""

    def _compute(self, operation: Operation) -> None:
        if operation.result_type == ResultType.CALCULATION:
            a, _ = self._operands(operation)
            self._variables[operation.result] = a
            operation = replace(operation, value_a_type=ValueType.NUMBER, value_a=a)
        super()._compute(operation)


class InPlace(ControllerCore):
    """A controller whose programs do."""

    interpreter = _InPlace


class _NoNesting(Run):
    """Jumps from an IF or ELSE to the next marker of the kind of its partner, whosever that is."""

    ways: Sequence[tuple[NodeType, NodeType]] = ()

    def _partner(self) -> int:
        partner, nodes = super()._partner(), self._program.nodes
        way = nodes[self._index].type, nodes[partner].type
        if way not in self.ways:
            return partner
        return next(n for n in range(self._index + 1, len(nodes)) if nodes[n].type is way[1])


def no_nesting(begin: NodeType, end: NodeType) -> type[ControllerCore]:
    """A controller whose programs jump so."""
    run = type("Run", (_NoNesting,), {"ways": [(begin, end)]})
    return type(
        f"{begin.name.title()}To{end.name.title()}", (ControllerCore,), {"interpreter": run}
    )


class _FromTheBeginning(Run):
    """Returns from the end of a loop to the first node of the program."""

    def _repeat(self, start: int) -> None:  # noqa: ARG002 - wherever it starts
        self._index = -1


class FromTheBeginning(ControllerCore):
    """A controller whose programs do."""

    interpreter = _FromTheBeginning


class ToTheFirstLoop(ControllerCore):
    """A controller whose programs return from the end of a loop to the first one that there is."""

    class interpreter(Run):  # noqa: N801 - the name of the attribute
        """What runs so."""

        def _repeat(self, start: int) -> None:
            kinds = [node.type for node in self._program.nodes]
            super()._repeat(kinds.index(NodeType.LOOP, 0, start + 1))


class NoElseIf(ControllerCore):
    """A controller in whose programs an IF within an ELSE does not hold."""

    class interpreter(Run):  # noqa: N801 - the name of the attribute
        """What runs so."""

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


class OldInputs(ControllerCore):
    """A controller whose programs calculate and compare with the inputs as they were at first."""

    class interpreter(Run):  # noqa: N801 - the name of the attribute
        """What runs so."""

        def __init__(self, *program: Any, **where: Any) -> None:
            super().__init__(*program, **where)
            inputs = self._plant.digital_inputs
            self._first = {port: int(inputs[port]) for port in range(1, 9)}

        def _value(self, value_type: int, value: int) -> int:
            if value_type == ValueType.INPUT_PORT:
                return self._first[value]
            return super()._value(value_type, value)


class _Subtracts(Run):
    """Compares by the sign of the difference, as far as 32 bits hold it."""

    def _operands(self, operation: Operation) -> tuple[int, int]:
        a, b = super()._operands(operation)
        if operation.opt >= Opt.GREATER:
            return (a - b + 2**31) % 2**32 - 2**31, 0
        return a, b


class Subtracts(ControllerCore):
    """A controller whose programs do."""

    interpreter = _Subtracts


class _ComparesAsFloats(Run):
    """Compares what a float of 4 bytes holds of two numbers."""

    def _operands(self, operation: Operation) -> tuple[int, int]:
        a, b = super()._operands(operation)
        if operation.opt >= Opt.GREATER:
            return round(single(a)), round(single(b))
        return a, b


class ComparesAsFloats(ControllerCore):
    """A controller whose programs do."""

    interpreter = _ComparesAsFloats


class _SixteenBitKeys(Run):
    """Of a key two bytes count: the first variable that has them is meant."""

    def _value(self, kind: int, value: int) -> int:
        if kind == ValueType.VARIABLE:
            value = next(key for key in self._variables if not (key - value) % 2**16)
        return super()._value(kind, value)


class SixteenBitKeys(ControllerCore):
    """A controller whose programs do."""

    interpreter = _SixteenBitKeys


class _AssignsBytes(Run):
    """What is assigned is a byte with a sign."""

    def _compute(self, operation: Operation) -> None:
        super()._compute(operation)
        if operation.result_type == ResultType.ASSIGNMENT:
            held = self._variables[operation.result]
            self._variables[operation.result] = (held + 2**7) % 2**8 - 2**7


class AssignsBytes(ControllerCore):
    """A controller whose programs do."""

    interpreter = _AssignsBytes


class _AssignsNoInputs(Run):
    """An assignment of an input is left out."""

    def _compute(self, operation: Operation) -> None:
        no_input = operation.value_a_type != ValueType.INPUT_PORT
        if operation.result_type != ResultType.ASSIGNMENT or no_input:
            super()._compute(operation)


class AssignsNoInputs(ControllerCore):
    """A controller whose programs do."""

    interpreter = _AssignsNoInputs


class _PutsNumbersOnly(Run):
    """A port is set to a number, and not to a variable."""

    def _compute(self, operation: Operation) -> None:
        is_number = operation.value_a_type == ValueType.NUMBER
        if is_number or operation.result_type != ResultType.SET_PORT:
            super()._compute(operation)


class PutsNumbersOnly(ControllerCore):
    """A controller whose programs do."""

    interpreter = _PutsNumbersOnly


class _TwiceIsOnce(Run):
    """To a variable nothing is added where that is the same one."""

    def _operands(self, operation: Operation) -> tuple[int, int]:
        a, b = super()._operands(operation)
        if operation.opt == Opt.ADD and operation.value_a_type == ValueType.VARIABLE:
            same = (ValueType.VARIABLE, operation.value_a)
            return a, 0 if (operation.value_b_type, operation.value_b) == same else b
        return a, b


class TwiceIsOnce(ControllerCore):
    """A controller whose programs do."""

    interpreter = _TwiceIsOnce


class _MultipliesFloats(Run):
    """A product is what a float of 4 bytes holds of it."""

    def _operands(self, operation: Operation) -> tuple[int, int]:
        a, b = super()._operands(operation)
        return (round(single(a * b)), 1) if operation.opt == Opt.MULTIPLY else (a, b)


class MultipliesFloats(ControllerCore):
    """A controller whose programs do."""

    interpreter = _MultipliesFloats


class _QuotientsWithoutSign(Run):
    """A quotient has no sign, and what is reckoned from it has one again."""

    def _compute(self, operation: Operation) -> None:
        super()._compute(operation)
        if operation.opt == Opt.DIVIDE and operation.result in self._variables:
            self._variables[operation.result] %= 2**32


class QuotientsWithoutSign(ControllerCore):
    """A controller whose programs do."""

    interpreter = _QuotientsWithoutSign


class _HurriesInBranches(Run):
    """Behind an IF there is no waiting."""

    def _begin(self, node: Node, now_s: float) -> float:
        before = self._program.nodes[: self._index]
        ends_s = super()._begin(node, now_s)
        hurries = isinstance(node.data, WaitSeconds) and any(n.type == NodeType.IF for n in before)
        return now_s if hurries else ends_s


class HurriesInBranches(ControllerCore):
    """A controller whose programs do."""

    interpreter = _HurriesInBranches


class SetsPortsOnce(ControllerCore):
    """In a run an output node does nothing to the port that the one before it has set."""

    class interpreter(Run):  # noqa: N801 - the name of the attribute
        """What runs so."""

        port = 0

        def _set_output(self, output: SetOutput) -> None:
            if output.port != self.port:
                super()._set_output(output)
            self.port = output.port


class EndsLoopsByAnEndif(ControllerCore):
    """An ENDIF ends whatever began last; a loop that it ends is left out."""

    def parse_program(self, data: bytes) -> Program | None:
        """Leave it out."""
        program = super().parse_program(data)
        if program is None:
            with suppress(ProgramError):
                nodes = parse(data).nodes
                if [nodes[0].type, nodes[-1].type] == [NodeType.LOOP, NodeType.ENDIF]:
                    program = replace(parse(data), nodes=nodes[1:-1])
        return program


class CountsLoopsToo(ControllerCore):
    """From an IF that does not hold the markers are counted, and a loop's for one that begins."""

    class interpreter(Run):  # noqa: N801 - the name of the attribute
        """What runs so."""

        def _partner(self) -> int:
            index, partner = self._index, super()._partner()
            nodes = self._program.nodes
            loops = sum(node.type == NodeType.LOOP for node in nodes[index:partner])
            return len(nodes) - 1 if nodes[index].type == NodeType.IF and loops else partner


class _CalculatesInFloats(Run):
    """It calculates with what a float of 4 bytes holds of two numbers."""

    def _operands(self, operation: Operation) -> tuple[int, int]:
        a, b = super()._operands(operation)
        return (a, b) if operation.opt >= Opt.GREATER else (round(single(a)), round(single(b)))


class CalculatesInFloats(ControllerCore):
    """A controller whose programs do."""

    interpreter = _CalculatesInFloats


class _ComparesWithTheKey(Run):
    """Compares with the key of a variable, where that is the second operand."""

    def _operands(self, operation: Operation) -> tuple[int, int]:
        a, b = super()._operands(operation)
        return a, operation.value_b if operation.opt >= Opt.GREATER else b


class ComparesWithTheKey(ControllerCore):
    """A controller whose programs do."""

    interpreter = _ComparesWithTheKey


class CurvesEndWithTheFile(TakesShortCurves):
    """A curve that counts three points may have two, where the file ends behind them."""

    forgiven = frozenset({"P-counts-past-end", "P-curve-short"})

    def parse_program(self, data: bytes) -> Program | None:
        """Look at the counts alone."""
        program = super().parse_program(data)
        if program is None:
            return None
        curves = (node for node in parse(data).nodes if node.type == NodeType.CURVE_MOVE)
        return None if any(node.counts < 3 for node in curves) else program


class KeepsPrograms(ControllerCore):
    """What a program does is found out once for each name."""

    def kept_by(self, name: bytes) -> object:
        """By what it is found again."""
        return name

    @cached_property
    def programs(self) -> dict[object, Program]:
        """What was found out."""
        return {}

    def _program(self, name: bytes) -> Program | None:
        program = super()._program(name)
        return program and self.programs.setdefault(self.kept_by(name), program)


class KeepsSums(KeepsPrograms):
    """It is found out once for each size and sum of bytes."""

    def kept_by(self, name: bytes) -> object:
        """By these."""
        content = self.store.read(name)
        return len(content), sum(content)


@pytest.mark.parametrize(
    ("core", "tries", "requirement"),
    [
        (no_nesting(NodeType.IF, NodeType.ELSE), "6.5/24", "6.5/24"),
        (no_nesting(NodeType.IF, NodeType.ENDIF), "6.5/24", "6.5/24"),
        (no_nesting(NodeType.ELSE, NodeType.ENDIF), "6.5/24", "6.5/24"),
        (FromTheBeginning, "6.5/23", "6.5/23"),
        (ToTheFirstLoop, "6.5/23", "6.5/23"),
        (WaitsOn, "6.5/20", "6.5/20"),
        (KeepsPrograms, "6.5/19", "6.5/19"),
        (SetsPortsOnce, "6.5/19", "6.5/19"),
        (KeepsPrograms, "6.5/24", "6.5/24"),
        (KeepsSums, "6.6a/13", "6.6a/13"),
        (RunsWhatComes, "6.5/19", "6.5/19"),
        (InPlace, "6.6a/14", "6.6a/14"),
        (NoElseIf, "6.5/24", "6.5/24"),
        (GoesOn, "6.5/26", "6.5/26"),
        (Subtracts, "6.6a/12", "6.6a/12"),
        (ComparesAsFloats, "6.6a/12", "6.6a/12"),
        (MultipliesFloats, "6.6a/11", "6.6a/11"),
        (QuotientsWithoutSign, "6.6a/11", "6.6a/11"),
        (TwiceIsOnce, "6.6a/14", "6.6a/14"),
        (PutsNumbersOnly, "6.6a/13", "6.6a/13"),
        (SixteenBitKeys, "6.6a/13", "6.6a/13"),
        (AssignsBytes, "6.6a/13", "6.6a/13"),
        (AssignsNoInputs, "6.6a/14", "6.6a/14"),
        (HurriesInBranches, "6.5/20", "6.5/20"),
        (EndsLoopsByAnEndif, "6.5/28", "6.5/28"),
        (CurvesEndWithTheFile, "6.5/28", "6.5/28"),
        (CountsLoopsToo, "6.5/24", "6.5/24"),
        (CalculatesInFloats, "6.6a/11", "6.6a/11"),
        (ComparesWithTheKey, "6.6a/14", "6.6a/14"),
    ],
)
def test_it_is_found(tried: Try, core: type[ControllerCore], tries: str, requirement: str) -> None:
    """A case of what it tries fails, for what is violated."""
    assert requirement in tried(core, tries, examples=1).failed


def test_old_inputs_are_found(tried: Try) -> None:
    """So does one of what the inputs are while a program runs, where a hook can drive them."""
    assert "6.6a/14" in tried(OldInputs, "6.5/21", examples=1, handled=("set_input",)).failed


def test_it_is_told_of_which_program_it_is(tried: Try) -> None:
    """Who wrote the robot sees what it did wrong: the program stands with what was observed."""
    failed = tried(NoElseIf, "6.5/24", examples=1)["6.5/24"]
    assert "of this program: 1 if " in failed.observed
    assert "; 2 set port " in failed.observed
