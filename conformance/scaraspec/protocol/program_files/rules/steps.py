"""Rules for single nodes: points, waits, outputs, timers (6.5)."""

from collections.abc import Iterator

from scaraspec.protocol.program_files.model import (
    SECOND_US,
    Point,
    SetOutput,
    WaitInput,
    WaitSeconds,
    WaitTimer,
)
from scaraspec.protocol.program_files.rules.base import LintContext, LintRule, Problem, Severity
from scaraspec.protocol.program_files.tables import Condition, NodeType, Opt, PortType
from scaraspec.user_message import UserMessage

_TURN_DEG = 360
_EARLIEST_S = 10**9  # an instant in 2001; the robot is newer
_LAST_LONG_S = 2**31 - 1  # the last instant in a long of 4 bytes
_FULL_DUTY = 100


def _node_type(context: LintContext) -> Iterator[Problem]:
    """A node type is 1 to 13 (L904-920)."""
    for index, node in enumerate(context.program.nodes):
        if not NodeType.has(node.type):
            yield Problem(
                UserMessage("the node type is {type}; it must be 1 to 13", type=node.type),
                node=index,
            )


def _point_pose(context: LintContext) -> Iterator[Problem]:
    """A point is four joint values (L926); large values are probably a pose (A-6.5-2)."""
    for index, point in context.data(Point):
        if any(abs(value) > _TURN_DEG for value in point.values):
            yield Problem(
                "the point has a value beyond 360, so it is probably x, y, z, thetaX and not four "
                "joint values: check how the robot interprets it before you run the program",
                node=index,
            )


def _wait_zero(context: LintContext) -> Iterator[Problem]:
    """A wait has a duration above 0 (L928)."""
    for index, wait in context.data(WaitSeconds):
        if wait.duration_s == 0:
            yield Problem("the node waits for 0 seconds, which has no effect", node=index)


def _wait_condition(context: LintContext) -> Iterator[Problem]:
    """A condition is 1 to 5 (L932); the order differs from that of the operators (A-6.5-11)."""
    for index, wait in context.data(WaitInput):
        if Condition.has(wait.condition):
            continue
        if Opt.has(wait.condition):
            yield Problem(
                UserMessage(
                    "the condition is {condition}, which is an operator; conditions are 1 to "
                    "5, where 4 is <= and 5 is >=",
                    condition=wait.condition,
                ),
                node=index,
                requirements=("6.5/9", "6.5/8"),
            )
        else:
            yield Problem(
                UserMessage(
                    "the condition is {condition}; it must be 1 to 5", condition=wait.condition
                ),
                node=index,
                requirements=("6.5/8",),
            )


def _digital_waits(context: LintContext) -> Iterator[tuple[int, WaitInput]]:
    for index, wait in context.data(WaitInput):
        if context.port_type(wait.port) == PortType.DIGITAL_INPUT:
            yield index, wait


def _wait_never(context: LintContext) -> Iterator[Problem]:
    """A wait for a digital input can end (A-6.5-10)."""
    for index, wait in _digital_waits(context):
        if not Condition.has(wait.condition):
            continue
        condition = Condition(wait.condition)
        if not any(condition.holds(state, wait.value_hundredths) for state in (0, 1, 100)):
            yield Problem(
                UserMessage(
                    "digital input {port} is never {condition} {value:g}: the program waits "
                    "forever",
                    port=wait.port,
                    condition=condition.name.lower().replace("_", " "),
                    value=wait.value_hundredths / 100,
                ),
                node=index,
            )


def _wait_value(context: LintContext) -> Iterator[Problem]:
    """A wait for a digital input compares with 0 or 100 (L934)."""
    for index, wait in _digital_waits(context):
        if wait.value_hundredths not in (0, 1, 100):
            yield Problem(
                UserMessage(
                    "digital input {port} is compared with {value:g}; its states are 0 and 1, "
                    "stored as 0 and 100",
                    port=wait.port,
                    value=wait.value_hundredths / 100,
                ),
                node=index,
            )


def _wait_unscaled(context: LintContext) -> Iterator[Problem]:
    """A wait for a digital 1 stores 100 (L934, A-6.5-10)."""
    for index, wait in _digital_waits(context):
        if wait.value_hundredths == 1:
            yield Problem(
                UserMessage(
                    "digital input {port} is compared with a stored 1; a robot that scales all "
                    "inputs interprets it as 0.01",
                    port=wait.port,
                ),
                node=index,
            )


def _output_type(context: LintContext) -> Iterator[Problem]:
    """An output is PWM (3) or TTL (4) (L936)."""
    for index, output in context.data(SetOutput):
        if output.type not in (PortType.PWM_OUTPUT, PortType.DIGITAL_OUTPUT):
            yield Problem(
                UserMessage(
                    "the output type is {type}; it must be 3 (PWM) or 4 (TTL)", type=output.type
                ),
                node=index,
            )


def _output_value(context: LintContext) -> Iterator[Problem]:
    """A TTL output is set to 0 or 1 (A-6.5-12)."""
    for index, output in context.data(SetOutput):
        if output.type == PortType.DIGITAL_OUTPUT and output.value not in (0, 1):
            yield Problem(
                UserMessage(
                    "TTL output {port} is set to {value}; it must be 0 or 1",
                    port=output.port,
                    value=output.value,
                ),
                node=index,
            )


def _pwm_value(context: LintContext) -> Iterator[Problem]:
    """A PWM output has a duty cycle of 0 to 100 and a time base above 0 (A-6.5-12)."""
    for index, output in context.data(SetOutput):
        if output.type != PortType.PWM_OUTPUT:
            continue
        if output.value > _FULL_DUTY or output.time_base == 0:
            yield Problem(
                UserMessage(
                    "PWM output {port} has duty cycle {duty} and time base {time_base}; the "
                    "document defines no units, so test it without a load",
                    port=output.port,
                    duty=output.value,
                    time_base=output.time_base,
                ),
                node=index,
            )


def _timer_microseconds(context: LintContext) -> Iterator[Problem]:
    """Microseconds are less than a second (L938)."""
    for index, timer in context.data(WaitTimer):
        if not 0 <= timer.microseconds < SECOND_US:
            yield Problem(
                UserMessage(
                    "the timer has {microseconds} microseconds; the range is 0 to 999999",
                    microseconds=timer.microseconds,
                ),
                node=index,
            )


def _timer_past(context: LintContext) -> Iterator[Problem]:
    """A timer is an instant, not a duration (L938)."""
    for index, timer in context.data(WaitTimer):
        if timer.seconds < _EARLIEST_S:
            yield Problem(
                UserMessage(
                    "the timer waits until second {seconds} since 1970, which is before 2001: "
                    "the value must be an instant, not a duration",
                    seconds=timer.seconds,
                ),
                node=index,
            )


def _timer_2038(context: LintContext) -> Iterator[Problem]:
    """An instant fits into a long of 4 bytes (A-6.1-3, A-6.5-13)."""
    for index, timer in context.data(WaitTimer):
        if timer.seconds > _LAST_LONG_S:
            yield Problem(
                UserMessage(
                    "the timer waits until second {seconds} since 1970, after 2038: it does not "
                    "fit into a long of 4 bytes",
                    seconds=timer.seconds,
                ),
                node=index,
            )


STEP_RULES = (
    LintRule("P-node-type", Severity.ERROR, ("6.5/2",), _node_type),
    LintRule("P-wait-condition", Severity.ERROR, ("6.5/8", "6.5/9"), _wait_condition),
    LintRule("P-output-type", Severity.ERROR, ("6.5/11",), _output_type),
    LintRule("P-timer-microseconds", Severity.ERROR, ("6.5/12",), _timer_microseconds),
    LintRule("P-wait-never", Severity.WARNING, ("6.5/9",), _wait_never),
    LintRule("P-wait-value", Severity.WARNING, ("6.5/10",), _wait_value),
    LintRule("P-output-value", Severity.WARNING, ("6.5/11",), _output_value),
    LintRule("P-timer-past", Severity.WARNING, ("6.5/12",), _timer_past),
    LintRule("P-point-pose", Severity.INFO, ("6.5/6",), _point_pose),
    LintRule("P-wait-zero", Severity.INFO, ("6.5/7",), _wait_zero),
    LintRule("P-wait-unscaled", Severity.INFO, ("6.5/10",), _wait_unscaled),
    LintRule("P-pwm-value", Severity.INFO, ("6.5/11",), _pwm_value),
    LintRule("P-timer-2038", Severity.INFO, ("6.5/12",), _timer_2038),
)
