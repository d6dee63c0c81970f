"""Types of the rules: severity, context, problem and rule."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import Enum
from functools import cached_property
from typing import TypeVar

from scaraspec.protocol.program_files.layout import Layout
from scaraspec.protocol.program_files.model import Node, NodeData, Program
from scaraspec.protocol.program_files.structure import Structure

_Data = TypeVar("_Data", bound=NodeData)


class Severity(Enum):
    """The severity of a finding.

    ERROR: the document forbids it, or it cannot be executed. WARNING: the document leaves it open,
    or it is probably unintended. INFO: a note.
    """

    ERROR = "error"
    WARNING = "warning"
    INFO = "info"

    __hash__ = object.__hash__


@dataclass(frozen=True)
class LintContext:
    """The program to check, and its layout if it was parsed from bytes."""

    program: Program
    layout: Layout | None = None

    @cached_property
    def structure(self) -> Structure:
        """The structure of the nodes."""
        return Structure.of(self.program.nodes)

    @cached_property
    def keys(self) -> frozenset[int]:
        """The keys of the variables."""
        return frozenset(variable.key for variable in self.program.variables)

    def port_type(self, port: int) -> int | None:
        """Return the type of a port, or None if there is no such port; the first port is 1."""
        ports = self.program.ports
        return ports[port - 1] if 1 <= port <= len(ports) else None

    def nodes(self, *types: int) -> Iterator[tuple[int, Node]]:
        """Yield the nodes of these types, with their index."""
        for index, node in enumerate(self.program.nodes):
            if node.type in types:
                yield index, node

    def data(self, kind: type[_Data]) -> Iterator[tuple[int, _Data]]:
        """Yield the node data of this class, with the index of the node."""
        for index, node in enumerate(self.program.nodes):
            if isinstance(node.data, kind):
                yield index, node.data


@dataclass(frozen=True, slots=True)
class Problem:
    """A violation of a rule, and its place.

    Attributes:
        message: The description, in one sentence.
        node: Index of the node, if any.
        variable: Index of the variable, if any.
        requirements: The violated requirements; by default those of the rule.
    """

    message: str
    node: int | None = None
    variable: int | None = None
    requirements: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class LintRule:
    """One static rule.

    Attributes:
        code: The stable name of the rule.
        severity: The severity of its findings.
        requirements: All requirements of the catalogue that its findings may cite.
        check: Finds the problems; its docstring states the rule.
    """

    code: str
    severity: Severity
    requirements: tuple[str, ...]
    check: Callable[[LintContext], Iterator[Problem]]
