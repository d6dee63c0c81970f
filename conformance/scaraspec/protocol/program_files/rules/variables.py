"""Rules for user variables and names (6.4, and the alias of 6.5)."""

from collections.abc import Iterator

from scaraspec.protocol.program_files.model import ALIAS_BYTES, VARIABLE_NAME_BYTES, Operation
from scaraspec.protocol.program_files.rules.base import LintContext, LintRule, Problem, Severity
from scaraspec.protocol.program_files.tables import ResultType, ValueType
from scaraspec.user_message import UserMessage


def _key_twice(context: LintContext) -> Iterator[Problem]:
    """Keys are unique (不可重复, L868)."""
    first: dict[int, int] = {}
    for index, variable in enumerate(context.program.variables):
        if variable.key in first:
            yield Problem(
                UserMessage(
                    "variable {first} already has the key {key}",
                    key=variable.key,
                    first=first[variable.key] + 1,
                ),
                variable=index,
            )
        else:
            first[variable.key] = index


def _variable_unused(context: LintContext) -> Iterator[Problem]:
    """Every variable is used by a node (L868)."""
    used = set()
    for _, operation in context.data(Operation):
        if operation.result_type in (ResultType.CALCULATION, ResultType.ASSIGNMENT):
            used.add(operation.result)
        if operation.value_a_type == ValueType.VARIABLE:
            used.add(operation.value_a)
        if operation.value_b_type == ValueType.VARIABLE:
            used.add(operation.value_b)
    for index, variable in enumerate(context.program.variables):
        if variable.key not in used:
            yield Problem(UserMessage("no node uses key {key}", key=variable.key), variable=index)


def _name_full(context: LintContext) -> Iterator[Problem]:
    """The name of a variable ends with a NUL within its 20 bytes (A-6.4-1)."""
    for index, variable in enumerate(context.program.variables):
        if len(variable.name) == VARIABLE_NAME_BYTES:
            yield Problem(
                UserMessage(
                    "the name fills all {size_bytes} bytes: a reader that expects a NUL continues "
                    "into the value",
                    size_bytes=VARIABLE_NAME_BYTES,
                ),
                variable=index,
            )


def _alias_full(context: LintContext) -> Iterator[Problem]:
    """An alias ends with a NUL within its 30 bytes (A-6.5-1)."""
    for index, node in enumerate(context.program.nodes):
        if len(node.alias) == ALIAS_BYTES:
            yield Problem(
                UserMessage(
                    "the alias fills all {size_bytes} bytes: a reader that expects a NUL continues "
                    "into the node type",
                    size_bytes=ALIAS_BYTES,
                ),
                node=index,
            )


VARIABLE_RULES = (
    LintRule("P-key-twice", Severity.ERROR, ("6.4/2",), _key_twice),
    LintRule("P-variable-unused", Severity.INFO, ("6.4/3",), _variable_unused),
    LintRule("P-name-full", Severity.INFO, ("6.4/4",), _name_full),
    LintRule("P-alias-full", Severity.INFO, ("6.5/1",), _alias_full),
)
