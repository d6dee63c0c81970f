"""The nouns of the rules: what is looked at, what is found, and what a rule is."""

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
    """What a finding means.

    ERROR: the document forbids it, or it cannot be executed. WARNING: the document leaves it open
    or it does something that was hardly meant. INFO: worth knowing.
    """

    ERROR = "error"
    WARNING = "warning"
    INFO = "info"

    __hash__ = object.__hash__


@dataclass(frozen=True)
class LintContext:
    """A program under the rules, and its layout if it was read from bytes."""

    program: Program
    layout: Layout | None = None

    @cached_property
    def structure(self) -> Structure:
        """How its nodes belong together."""
        return Structure.of(self.program.nodes)

    @cached_property
    def keys(self) -> frozenset[int]:
        """The keys of its variables."""
        return frozenset(variable.key for variable in self.program.variables)

    def port_type(self, port: int) -> int | None:
        """How a port is configured, or None if there is no such port; port 1 is the first."""
        ports = self.program.ports
        return ports[port - 1] if 1 <= port <= len(ports) else None

    def nodes(self, *types: int) -> Iterator[tuple[int, Node]]:
        """Its nodes of these types, each with its index."""
        for index, node in enumerate(self.program.nodes):
            if node.type in types:
                yield index, node

    def data(self, kind: type[_Data]) -> Iterator[tuple[int, _Data]]:
        """The data of its nodes that have this kind, each with the node's index."""
        for index, node in enumerate(self.program.nodes):
            if isinstance(node.data, kind):
                yield index, node.data


@dataclass(frozen=True, slots=True)
class Problem:
    """Where a rule is broken, and how.

    Attributes:
        message: One sentence.
        node: Index of the node, if it is about one.
        variable: Index of the variable, if it is about one.
        requirements: The requirements broken; those of the rule unless given.
    """

    message: str
    node: int | None = None
    variable: int | None = None
    requirements: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class LintRule:
    """One static rule.

    Attributes:
        code: Its name, which stays.
        severity: Of every finding that it makes.
        requirements: Every requirement of the catalogue that a finding may be about.
        check: Finds the problems; its docstring says what is right.
    """

    code: str
    severity: Severity
    requirements: tuple[str, ...]
    check: Callable[[LintContext], Iterator[Problem]]
