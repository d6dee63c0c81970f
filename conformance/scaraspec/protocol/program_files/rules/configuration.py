"""Rules for the configuration, and for all floats (6.3)."""

import math
from collections.abc import Iterator

from scaraspec.protocol.program_files.layout import is_implausible_coordinate
from scaraspec.protocol.program_files.model import Point
from scaraspec.protocol.program_files.rules.base import LintContext, LintRule, Problem, Severity
from scaraspec.protocol.program_files.tables import PortType
from scaraspec.user_message import UserMessage


def _not_finite(context: LintContext) -> Iterator[Problem]:
    """All floats are finite (A-6.1-4)."""
    for name, values in (
        ("toolPos", context.program.tool_position),
        ("tcpPos", context.program.tool_center),
    ):
        for index, value in enumerate(values):
            if not math.isfinite(value):
                yield Problem(
                    UserMessage(
                        "{name}[{index}] is {value}, not a finite number",
                        name=name,
                        index=index,
                        value=value,
                    )
                )
    for node, point in context.data(Point):
        for index, value in enumerate(point.values):
            if not math.isfinite(value):
                yield Problem(
                    UserMessage(
                        "point[{index}] is {value}, not a finite number",
                        index=index,
                        value=value,
                    ),
                    node=node,
                )


def _implausible(name: str, values: tuple[float, ...]) -> Iterator[Problem]:
    for index, value in enumerate(values):
        if math.isfinite(value) and is_implausible_coordinate(value):
            yield Problem(
                UserMessage(
                    "{name}[{index}] is {value:g}, implausible for mm or degrees: the byte order "
                    "or the position may be wrong",
                    name=name,
                    index=index,
                    value=value,
                )
            )


def _tool_position(context: LintContext) -> Iterator[Problem]:
    """The initial tool position is six values in mm and degrees (L846)."""
    yield from _implausible("toolPos", context.program.tool_position)


def _tool_center(context: LintContext) -> Iterator[Problem]:
    """The working end of the tool is three values in mm (L848)."""
    yield from _implausible("tcpPos", context.program.tool_center)


def _port_type(context: LintContext) -> Iterator[Problem]:
    """A port type is 0 to 4 (L850-856)."""
    for port, port_type in enumerate(context.program.ports, start=1):
        if not PortType.has(port_type):
            yield Problem(
                UserMessage(
                    "port {port} is configured as {port_type}; port types are 0 to 4",
                    port=port,
                    port_type=port_type,
                )
            )


CONFIGURATION_RULES = (
    LintRule("P-not-finite", Severity.ERROR, ("6.3/4",), _not_finite),
    LintRule("P-port-type", Severity.ERROR, ("6.3/3",), _port_type),
    LintRule("P-tool-position", Severity.WARNING, ("6.3/1",), _tool_position),
    LintRule("P-tool-center", Severity.WARNING, ("6.3/2",), _tool_center),
)
