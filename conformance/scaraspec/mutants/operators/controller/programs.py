"""Operators that change which program files are accepted, and how programs are executed."""

from collections.abc import Callable
from dataclasses import replace

from scaraspec.protocol.program_files import (
    NodeType,
    Program,
    ProgramError,
    Severity,
    lint,
    parse,
)
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.interpreter import Run

Core = type[ControllerCore]


def with_interpreter(run: type[Run]) -> Core:
    """Programs are executed by another interpreter."""
    return type("WithInterpreter", (ControllerCore,), {"interpreter": run})


def program_file(change: Callable[[bytes], bytes]) -> Core:
    """The bytes of a program file are changed before it is parsed."""

    class ProgramFile(ControllerCore):
        def parse_program(self, data: bytes) -> Program | None:
            return super().parse_program(change(data))

    return ProgramFile


class _IgnoresMissingPartners(Run):
    def _partner(self) -> int:
        partner = self._structure.partners[self._index]
        return self._index if partner is None else partner


def accepts_errors(*codes: str, change: Callable[[Program], Program] | None = None) -> Core:
    """Programs with these errors of `lint` are executed; `change` is applied to them first."""

    class AcceptsErrors(ControllerCore):
        interpreter = _IgnoresMissingPartners

        def parse_program(self, data: bytes) -> Program | None:
            try:
                program = parse(data)
            except ProgramError:
                return None
            errors = {found.code for found in lint(program) if found.severity is Severity.ERROR}
            if not errors <= set(codes):
                return None
            return change(program) if change else program

    return AcceptsErrors


def straightened(program: Program) -> Program:
    """Return the program with straight moves in place of curves."""
    nodes = [
        replace(node, type=NodeType.STRAIGHT_MOVE) if node.type == NodeType.CURVE_MOVE else node
        for node in program.nodes
    ]
    return replace(program, nodes=tuple(nodes))
