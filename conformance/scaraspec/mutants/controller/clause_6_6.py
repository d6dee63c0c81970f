"""Mutants of clause 6.6: operations of programs."""

import struct
from collections.abc import Callable, Mapping
from dataclasses import replace

from scaraspec.mutants.controller import Core, mutant, row
from scaraspec.mutants.operators.controller.programs import with_interpreter
from scaraspec.protocol.program_files import Operation, Opt, ResultType, ValueType
from scaraspec.virtual_controller.interpreter import Run

_COMPARISONS = (Opt.GREATER, Opt.LESS, Opt.EQUAL, Opt.GREATER_OR_EQUAL, Opt.LESS_OR_EQUAL)


def _int16(value: int) -> int:
    return (value + 2**15) % 2**16 - 2**15


# ---------------------------------------------------------------------- operators


def _operands(change: Callable[[int, int], tuple[int, int]], *opts: Opt) -> Core:
    """The operands of some operators are changed."""

    class ChangedOperands(Run):
        def _operands(self, operation: Operation) -> tuple[int, int]:
            a, b = super()._operands(operation)
            return change(a, b) if operation.opt in opts else (a, b)

    return with_interpreter(ChangedOperands)


def _operators(others: Mapping[int, Opt]) -> Core:
    """Operators are replaced by others."""

    class OtherOperators(Run):
        def _holds(self, operation: Operation) -> bool:
            return super()._holds(_replaced(operation))

        def _compute(self, operation: Operation) -> None:
            super()._compute(_replaced(operation))

    def _replaced(operation: Operation) -> Operation:
        return replace(operation, opt=others.get(operation.opt, operation.opt))

    return with_interpreter(OtherOperators)


row(
    "subtracts-the-other-way",
    "6.6a/11",
    "A is subtracted from B.",
    _operands(lambda a, b: (b, a), Opt.SUBTRACT),
)
row(
    "divides-the-other-way",
    "6.6a/11",
    "B is divided by A.",
    _operands(lambda a, b: (b, a or 1), Opt.DIVIDE),
)
row(
    "subtracts-sizes-below-zero",
    "6.6a/11",
    "If both operands are negative, their absolute values are subtracted.",
    _operands(lambda a, b: (abs(a), abs(b)) if max(a, b) < 0 else (a, b), Opt.SUBTRACT),
    subtle=True,
)


@mutant("forgets-what-meets-itself", "6.6a/11", subtle=True)
class ReadsSameVariableAsZero(Run):
    """An operation of a variable with itself uses 0 for both operands."""

    def _operands(self, operation: Operation) -> tuple[int, int]:
        first = (operation.value_a_type, operation.value_a)
        itself = (operation.value_b_type, operation.value_b) == first
        if itself and operation.value_a_type == ValueType.VARIABLE:
            return 0, 0
        return super()._operands(operation)


row(
    "adds-bytes",
    "6.6a/11",
    "An addition uses only the lowest byte of B.",
    _operands(lambda a, b: (a, (b + 128) % 256 - 128), Opt.ADD),
)
row(
    "multiplies-without-sign",
    "6.6a/11",
    "A multiplication ignores the signs.",
    _operands(lambda a, b: (abs(a), abs(b)), Opt.MULTIPLY),
)
row(
    "multiplies-halves",
    "6.6a/11",
    "A multiplication uses only the lower 16 bits of the operands.",
    _operands(lambda a, b: (_int16(a), _int16(b)), Opt.MULTIPLY),
    subtle=True,
)
row(
    "divides-rounding-up",
    "6.6a/11",
    "Quotients are rounded up.",
    _operands(lambda a, b: (-(-a // b), 1) if b else (a, b), Opt.DIVIDE),
)
row(
    "divides-rounding-to-nearest",
    "6.6a/11",
    "Quotients are rounded to the nearest integer.",
    _operands(lambda a, b: (round(a / b), 1) if b else (a, b), Opt.DIVIDE),
    subtle=True,
)
row(
    "divides-floats",
    "6.6a/11",
    "A dividend is converted to a float of four bytes, so that large numbers lose digits.",
    _operands(lambda a, b: (int(*struct.unpack("<f", struct.pack("<f", a))), b), Opt.DIVIDE),
    subtle=True,
)
row(
    "compares-without-sign",
    "6.6a/12",
    "Numbers are compared as unsigned: negative ones are greater than all others.",
    _operands(lambda a, b: (a % 2**32, b % 2**32), *_COMPARISONS),
    subtle=True,
)
row(
    "not-equal-below-zero",
    "6.6a/12",
    "A >= B does not hold for equal negative numbers.",
    _operands(lambda a, b: (a - 1, b) if a == b < 0 else (a, b), Opt.GREATER_OR_EQUAL),
    subtle=True,
)
row(
    "compares-halves",
    "6.6a/12",
    "Only the lower 16 bits are compared.",
    _operands(lambda a, b: (_int16(a), _int16(b)), *_COMPARISONS),
    subtle=True,
)
row(
    "compares-the-other-way",
    "6.6a/12",
    "The operands of a comparison are exchanged.",
    _operands(lambda a, b: (b, a), *_COMPARISONS),
)
row(
    "adds-where-it-multiplies",
    "6.6a/11",
    "Operator 3 adds.",
    _operators({Opt.MULTIPLY: Opt.ADD}),
)
row(
    "operators-as-conditions",
    "6.6a/12",
    "Operators 8 and 9 are exchanged, in the order of the conditions 4 and 5.",
    _operators({Opt.GREATER_OR_EQUAL: Opt.LESS_OR_EQUAL, Opt.LESS_OR_EQUAL: Opt.GREATER_OR_EQUAL}),
)
row(
    "greater-when-equal",
    "6.6a/12",
    "A > B also holds for equal numbers.",
    _operators({Opt.GREATER: Opt.GREATER_OR_EQUAL}),
    subtle=True,
)
row(
    "less-when-equal",
    "6.6a/12",
    "A < B also holds for equal numbers.",
    _operators({Opt.LESS: Opt.LESS_OR_EQUAL}),
    subtle=True,
)
row(
    "not-less-only-when-greater",
    "6.6a/12",
    "A >= B does not hold for equal numbers.",
    _operators({Opt.GREATER_OR_EQUAL: Opt.GREATER}),
    subtle=True,
)
row(
    "not-greater-only-when-less",
    "6.6a/12",
    "A <= B does not hold for equal numbers.",
    _operators({Opt.LESS_OR_EQUAL: Opt.LESS}),
    subtle=True,
)

# ---------------------------------------------------------------------- the result of a comparison


def _inverts(when: Callable[[int], bool]) -> Core:
    """A comparison is inverted, if its result field fulfils a condition."""

    class InvertsComparisons(Run):
        def _holds(self, operation: Operation) -> bool:
            return super()._holds(operation) != when(operation.result)

    return with_interpreter(InvertsComparisons)


row(
    "zero-is-false",
    "6.6a/2 6.5/24",
    "A comparison is inverted whatever its result field is.",
    _inverts(lambda _result: True),
)
row(
    "inverts-what-is-above-zero",
    "6.6a/2",
    "A comparison is inverted if its result field is positive.",
    _inverts(lambda result: result > 0),
    subtle=True,
)
row(
    "inverts-by-the-lowest-byte",
    "6.6a/2",
    "A comparison is inverted if the lowest byte of its result field is not 0.",
    _inverts(lambda result: result % 256 != 0),
    subtle=True,
)

# ---------------------------------------------------------------------- where results go


@mutant("keys-of-one-byte", "6.6a/13", subtle=True)
class ComparesByteOfKeys(Run):
    """A result is stored in the first variable whose key has the same lowest byte."""

    def _compute(self, operation: Operation) -> None:
        if operation.result_type != ResultType.SET_PORT:
            equal = (key for key in self._variables if (key - operation.result) % 256 == 0)
            operation = replace(operation, result=next(equal))
        super()._compute(operation)


@mutant("assigns-to-the-next-variable", "6.6a/13")
class AssignsToNextVariable(Run):
    """An assignment changes the variable after the one in the operation."""

    def _compute(self, operation: Operation) -> None:
        if operation.result_type == ResultType.ASSIGNMENT:
            keys = list(self._variables)
            key = keys[(keys.index(operation.result) + 1) % len(keys)]
            operation = replace(operation, result=key)
        super()._compute(operation)


@mutant("calculates-into-a", "6.6a/13")
class StoresResultInA(Run):
    """The result of a calculation is stored in the variable of its value A, if A is a variable."""

    def _compute(self, operation: Operation) -> None:
        stored = operation.result_type in (ResultType.CALCULATION, ResultType.ASSIGNMENT)
        if stored and operation.value_a_type == ValueType.VARIABLE:
            operation = replace(operation, result=operation.value_a)
        super()._compute(operation)


@mutant("ports-of-operations-from-zero", "6.6a/13")
class SetsNextPort(Run):
    """An operation that sets a port sets the one with the next number."""

    def _compute(self, operation: Operation) -> None:
        if operation.result_type == ResultType.SET_PORT:
            operation = replace(operation, result=operation.result % 16 + 1)
        super()._compute(operation)


@mutant("operations-only-switch-on", "6.6a/13")
class OnlySetsPortsToOne(Run):
    """An operation sets a port to 1 but never to 0."""

    def _compute(self, operation: Operation) -> None:
        if operation.result_type != ResultType.SET_PORT or self._operands(operation)[0]:
            super()._compute(operation)


@mutant("assigns-nothing", "6.6a/13")
class IgnoresAssignments(Run):
    """An assignment has no effect."""

    def _compute(self, operation: Operation) -> None:
        if operation.result_type != ResultType.ASSIGNMENT:
            super()._compute(operation)


@mutant("assigns-sizes", "6.6a/13", subtle=True)
class AssignsAbsoluteValues(Run):
    """An assigned value loses its sign."""

    def _operands(self, operation: Operation) -> tuple[int, int]:
        a, b = super()._operands(operation)
        return (abs(a) if operation.result_type == ResultType.ASSIGNMENT else a), b


# ---------------------------------------------------------------------- the meaning of values


@mutant("numbers-are-keys", "6.6a/14", subtle=True)
class ReadsNumbersAsKeys(Run):
    """A number that is the key of a variable is replaced by the value of the variable."""

    def _value(self, value_type: int, value: int) -> int:
        if value_type == ValueType.NUMBER and value in self._variables:
            return self._variables[value]
        return super()._value(value_type, value)


@mutant("keys-are-numbers", "6.6a/14")
class ReadsKeysAsNumbers(Run):
    """The key of a variable is used as a number if it is value B."""

    def _operands(self, operation: Operation) -> tuple[int, int]:
        a, b = super()._operands(operation)
        return a, operation.value_b if operation.value_b_type == ValueType.VARIABLE else b


def _reads(read: Callable[[Run, int], int]) -> Core:
    """The value of an input port is changed."""

    class ReadsInputs(Run):
        def _value(self, value_type: int, value: int) -> int:
            if value_type == ValueType.INPUT_PORT:
                return read(self, value)
            return super()._value(value_type, value)

    return with_interpreter(ReadsInputs)


row(
    "inputs-of-operations-from-zero",
    "6.6a/14",
    "An operation reads the input with the next number.",
    _reads(lambda self, port: self._input(port % 8 + 1)),
)
row(
    "inputs-inverted",
    "6.6a/14",
    "An input that is on has the value 0, and one that is off the value 1.",
    _reads(lambda self, port: 1 - self._input(port)),
)
row(
    "reads-outputs-for-inputs",
    "6.6a/14",
    "The output port with the same number is read in place of the input port.",
    _reads(lambda self, port: int(self._plant.digital_outputs[port])),
)
row(
    "inputs-are-numbers",
    "6.6a/14",
    "The number of an input port is used in place of its value.",
    _reads(lambda _run, port: port),
)
