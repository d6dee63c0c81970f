"""Rules about the ports that nodes use (6.3, 6.5, 6.6a)."""

from collections.abc import Iterator
from dataclasses import dataclass

from scaraspec.protocol.program_files.model import PORTS, Operation, SetOutput, WaitInput
from scaraspec.protocol.program_files.rules.base import LintContext, LintRule, Problem, Severity
from scaraspec.protocol.program_files.tables import PortType, ResultType, ValueType
from scaraspec.user_message import UserMessage

_INPUTS = (PortType.ANALOG_INPUT, PortType.DIGITAL_INPUT)
_OUTPUTS = (PortType.PWM_OUTPUT, PortType.DIGITAL_OUTPUT)


@dataclass(frozen=True, slots=True)
class _Use:
    """A node's use of a port, and the configurations that suit it."""

    node: int
    port: int
    suitable: tuple[PortType, ...]
    requirement: str


def _uses(subject: LintContext) -> Iterator[_Use]:
    for node, wait in subject.data(WaitInput):
        yield _Use(node, wait.port, _INPUTS, "6.5/8")
    for node, output in subject.data(SetOutput):
        suitable = tuple(kind for kind in _OUTPUTS if kind == output.type) or _OUTPUTS
        yield _Use(node, output.port, suitable, "6.5/11")
    for node, operation in subject.data(Operation):
        if operation.result_type == ResultType.SET_PORT:
            yield _Use(node, operation.result, _OUTPUTS, "6.6a/4")
        if operation.value_a_type == ValueType.INPUT_PORT:
            yield _Use(node, operation.value_a, _INPUTS, "6.6a/7")
        if operation.value_b_type == ValueType.INPUT_PORT:
            yield _Use(node, operation.value_b, _INPUTS, "6.6a/7")


def _port_number(subject: LintContext) -> Iterator[Problem]:
    """A port number is 1 to 40 (L839)."""
    for use in _uses(subject):
        if use.port != 0 and subject.port_type(use.port) is None:
            yield Problem(
                UserMessage(
                    "the node uses port {port}; ports are 1 to {ports}", port=use.port, ports=PORTS
                ),
                node=use.node,
                requirements=(use.requirement,),
            )


def _port_zero(subject: LintContext) -> Iterator[Problem]:
    """The first port is port 1, not port 0 (A-6.3-2)."""
    for use in _uses(subject):
        if use.port == 0:
            yield Problem(
                "the node uses port 0, which exists only if ports are counted from 0",
                node=use.node,
                requirements=(use.requirement,),
            )


def _port_config(subject: LintContext) -> Iterator[Problem]:
    """A port that a node uses is configured for that use (L839, L936)."""
    for use in _uses(subject):
        configured = subject.port_type(use.port)
        if configured is not None and configured not in use.suitable:
            needed = " or ".join(f"{kind.value}" for kind in use.suitable)
            yield Problem(
                UserMessage(
                    "the node uses port {port}, which is configured as {configured} and not "
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
