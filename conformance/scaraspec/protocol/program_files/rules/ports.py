"""Rules for the ports that nodes use (6.3, 6.5, 6.6a)."""

from collections.abc import Iterator
from dataclasses import dataclass

from scaraspec.protocol.program_files.model import PORTS, Operation, SetOutput, WaitInput
from scaraspec.protocol.program_files.rules.base import LintContext, LintRule, Problem, Severity
from scaraspec.protocol.program_files.tables import PortType, ResultType, ValueType
from scaraspec.user_message import UserMessage

_INPUTS = (PortType.ANALOG_INPUT, PortType.DIGITAL_INPUT)
_OUTPUTS = (PortType.PWM_OUTPUT, PortType.DIGITAL_OUTPUT)


@dataclass(frozen=True, slots=True)
class _PortUse:
    """The use of a port by a node, and the suitable port types."""

    node: int
    port: int
    suitable: tuple[PortType, ...]
    requirement: str


def _port_uses(context: LintContext) -> Iterator[_PortUse]:
    for node, wait in context.data(WaitInput):
        yield _PortUse(node, wait.port, _INPUTS, "6.5/8")
    for node, output in context.data(SetOutput):
        suitable = tuple(kind for kind in _OUTPUTS if kind == output.type) or _OUTPUTS
        yield _PortUse(node, output.port, suitable, "6.5/11")
    for node, operation in context.data(Operation):
        if operation.result_type == ResultType.SET_PORT:
            yield _PortUse(node, operation.result, _OUTPUTS, "6.6a/4")
        if operation.value_a_type == ValueType.INPUT_PORT:
            yield _PortUse(node, operation.value_a, _INPUTS, "6.6a/7")
        if operation.value_b_type == ValueType.INPUT_PORT:
            yield _PortUse(node, operation.value_b, _INPUTS, "6.6a/7")


def _port_number(context: LintContext) -> Iterator[Problem]:
    """A port number is 1 to 40 (L839)."""
    for use in _port_uses(context):
        if use.port != 0 and context.port_type(use.port) is None:
            yield Problem(
                UserMessage(
                    "the node uses port {port}; ports are 1 to {last}", port=use.port, last=PORTS
                ),
                node=use.node,
                requirements=(use.requirement,),
            )


def _port_zero(context: LintContext) -> Iterator[Problem]:
    """The first port is port 1, not port 0 (A-6.3-2)."""
    for use in _port_uses(context):
        if use.port == 0:
            yield Problem(
                "the node uses port 0, which exists only if port numbers start at 0",
                node=use.node,
                requirements=(use.requirement,),
            )


def _port_config(context: LintContext) -> Iterator[Problem]:
    """A port that a node uses is configured for that use (L839, L936)."""
    for use in _port_uses(context):
        configured = context.port_type(use.port)
        if configured is not None and configured not in use.suitable:
            needed = " or ".join(f"{kind.value}" for kind in use.suitable)
            yield Problem(
                UserMessage(
                    "the node uses port {port}, which is configured as {configured}, not "
                    "as {needed}",
                    port=use.port,
                    configured=configured,
                    needed=needed,
                ),
                node=use.node,
            )


PORT_RULES = (
    LintRule(
        "P-port-number", Severity.ERROR, ("6.5/8", "6.5/11", "6.6a/4", "6.6a/7"), _port_number
    ),
    LintRule("P-port-zero", Severity.WARNING, ("6.5/8", "6.5/11", "6.6a/4", "6.6a/7"), _port_zero),
    LintRule("P-port-config", Severity.WARNING, ("6.5/17",), _port_config),
)
