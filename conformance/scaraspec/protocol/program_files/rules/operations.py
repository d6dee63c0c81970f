"""Rules for operations (6.6a)."""

from collections.abc import Iterator

from scaraspec.protocol.program_files.model import Operation
from scaraspec.protocol.program_files.rules.base import LintContext, LintRule, Problem, Severity
from scaraspec.protocol.program_files.tables import NodeType, Opt, ResultType, ValueType
from scaraspec.user_message import UserMessage

_ARITHMETIC = (Opt.ADD, Opt.SUBTRACT, Opt.MULTIPLY, Opt.DIVIDE)
_COMPUTED = (ResultType.COMPARISON, ResultType.CALCULATION)  # these need an operator
_EFFECTS = (ResultType.CALCULATION, ResultType.ASSIGNMENT, ResultType.SET_PORT)
_STORED = (ResultType.CALCULATION, ResultType.ASSIGNMENT)  # these name a variable


def _operands(operation: Operation) -> tuple[tuple[str, int, int], ...]:
    return (
        ("A", operation.value_a_type, operation.value_a),
        ("B", operation.value_b_type, operation.value_b),
    )


def _result_type(context: LintContext) -> Iterator[Problem]:
    """A result type is 1 to 4 (L961-965)."""
    for index, operation in context.data(Operation):
        if not ResultType.has(operation.result_type):
            yield Problem(
                UserMessage(
                    "result_type is {result_type}; it must be 1 to 4",
                    result_type=operation.result_type,
                ),
                node=index,
            )


def _if_result(context: LintContext) -> Iterator[Problem]:
    """The operation of an IF is a comparison (A-6.5-14)."""
    for index, node in context.nodes(NodeType.IF):
        if isinstance(node.data, Operation) and node.data.result_type in _EFFECTS:
            yield Problem(
                UserMessage(
                    "the operation of the IF has result_type {result_type}; it must be 1 "
                    "(a comparison)",
                    result_type=node.data.result_type,
                ),
                node=index,
            )


def _comparison_lost(context: LintContext) -> Iterator[Problem]:
    """The operation of a calculation node has an effect (A-6.5-14)."""
    for index, node in context.nodes(NodeType.COMPUTE):
        if isinstance(node.data, Operation) and node.data.result_type == ResultType.COMPARISON:
            yield Problem("the result of the comparison is unused: only an IF uses it", node=index)


def _comparison_result(context: LintContext) -> Iterator[Problem]:
    """The result of a comparison is 0 in a file (A-6.6a-1)."""
    for index, operation in context.data(Operation):
        if operation.result_type == ResultType.COMPARISON and operation.result != 0:
            yield Problem(
                UserMessage(
                    "the result of the comparison is {result}, not 0: a robot that interprets "
                    "it as the expected outcome takes the other branch",
                    result=operation.result,
                ),
                node=index,
            )


def _result_key(context: LintContext) -> Iterator[Problem]:
    """A result is stored in a variable that exists (L963-964)."""
    for index, operation in context.data(Operation):
        if operation.result_type in _STORED and operation.result not in context.keys:
            yield Problem(
                UserMessage(
                    "the result is stored in key {result}, but no variable has this key",
                    result=operation.result,
                ),
                node=index,
            )


def _value_type(context: LintContext) -> Iterator[Problem]:
    """A value type is 0 to 3 (L967-973)."""
    for index, operation in context.data(Operation):
        for name, value_type, _ in _operands(operation):
            if not ValueType.has(value_type):
                yield Problem(
                    UserMessage(
                        "value{name}_type is {value_type}; it must be 0 to 3",
                        name=name,
                        value_type=value_type,
                    ),
                    node=index,
                )


def _value_missing(context: LintContext) -> Iterator[Problem]:
    """An operation has the values that it needs (A-6.6a-3)."""
    for index, operation in context.data(Operation):
        if operation.value_a_type == ValueType.NONE:
            yield Problem("the operation has no value A", node=index)
        if operation.value_b_type == ValueType.NONE and operation.result_type in _COMPUTED:
            yield Problem("the operation has no value B, but it needs two values", node=index)


def _value_key(context: LintContext) -> Iterator[Problem]:
    """A value refers to a variable that exists (L972)."""
    for index, operation in context.data(Operation):
        for name, value_type, value in _operands(operation):
            if value_type == ValueType.VARIABLE and value not in context.keys:
                yield Problem(
                    UserMessage(
                        "value {name} refers to key {value}, but no variable has this key",
                        name=name,
                        value=value,
                    ),
                    node=index,
                )


def _opt(context: LintContext) -> Iterator[Problem]:
    """An operator is 1 to 9, or 0 if nothing is computed (L975-986, A-6.6a-2)."""
    for index, operation in context.data(Operation):
        if not ResultType.has(operation.result_type) or Opt.has(operation.opt):
            continue
        if operation.result_type in _COMPUTED or operation.opt != 0:
            yield Problem(
                UserMessage("opt is {opt}; it must be 1 to 9", opt=operation.opt), node=index
            )


def _opt_result(context: LintContext) -> Iterator[Problem]:
    """The operator matches the result type (A-6.6a-3)."""
    for index, operation in context.data(Operation):
        if not Opt.has(operation.opt):
            continue
        arithmetic = operation.opt in _ARITHMETIC
        if operation.result_type == ResultType.COMPARISON and arithmetic:
            yield Problem(
                UserMessage(
                    "opt {opt} is arithmetic, but a comparison needs 5 to 9", opt=operation.opt
                ),
                index,
            )
        if operation.result_type == ResultType.CALCULATION and not arithmetic:
            yield Problem(
                UserMessage(
                    "opt {opt} is a comparison, but a calculation needs 1 to 4", opt=operation.opt
                ),
                index,
            )


def _assign_value(context: LintContext) -> Iterator[Problem]:
    """An assignment and a port setting have only value A (A-6.6a-2)."""
    for index, operation in context.data(Operation):
        plain = operation.result_type in (ResultType.ASSIGNMENT, ResultType.SET_PORT)
        if plain and operation.value_b_type != ValueType.NONE:
            yield Problem(
                UserMessage(
                    "the node has a value B with opt {opt}: some robots compute the result, others "
                    "use only A; use a calculation, and then assign its result",
                    opt=operation.opt,
                ),
                node=index,
            )


def _division_by_zero(context: LintContext) -> Iterator[Problem]:
    """Nothing is divided by the constant zero (A-6.6a-4)."""
    for index, operation in context.data(Operation):
        by_zero = operation.value_b_type == ValueType.NUMBER and operation.value_b == 0
        if operation.opt == Opt.DIVIDE and by_zero:
            yield Problem("the operation divides by the constant 0", node=index)


OPERATION_RULES = (
    LintRule("P-result-type", Severity.ERROR, ("6.6a/1",), _result_type),
    LintRule("P-if-result", Severity.ERROR, ("6.5/13",), _if_result),
    LintRule("P-result-key", Severity.ERROR, ("6.6a/3", "6.4/3"), _result_key),
    LintRule("P-value-type", Severity.ERROR, ("6.6a/5",), _value_type),
    LintRule("P-value-missing", Severity.ERROR, ("6.6a/5",), _value_missing),
    LintRule("P-value-key", Severity.ERROR, ("6.6a/6", "6.4/3"), _value_key),
    LintRule("P-opt", Severity.ERROR, ("6.6a/8",), _opt),
    LintRule("P-opt-result", Severity.ERROR, ("6.6a/9",), _opt_result),
    LintRule("P-comparison-lost", Severity.WARNING, ("6.5/13",), _comparison_lost),
    LintRule("P-comparison-result", Severity.WARNING, ("6.6a/2",), _comparison_result),
    LintRule("P-assign-value", Severity.WARNING, ("6.6a/8",), _assign_value),
    LintRule("P-division-by-zero", Severity.WARNING, ("6.6a/10",), _division_by_zero),
)
