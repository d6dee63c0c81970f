"""Faults of clause 6.6: operations of programs."""

import struct
from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import ClassVar

from scaraspec.mutants.operators.controller.programs import misrun
from scaraspec.protocol.program_files import Operation, Opt, ResultType, ValueType
from scaraspec.virtual_controller.interpreter import Run

_COMPARING = (
    Opt.GREATER,
    Opt.LESS,
    Opt.EQUAL,
    Opt.GREATER_OR_EQUAL,
    Opt.LESS_OR_EQUAL,
)


def _int16(value: int) -> int:
    return (value + 2**15) % 2**16 - 2**15


# ---------------------------------------------------------------------- operators


class _Alters(Run):
    """Gives some operators other operands."""

    opts: ClassVar[tuple[Opt, ...]]

    def altered(self, a: int, b: int) -> tuple[int, int]:
        """The operands that they get."""
        return a, b

    def _operands(self, operation: Operation) -> tuple[int, int]:
        a, b = super()._operands(operation)
        return self.altered(a, b) if operation.opt in self.opts else (a, b)


@misrun("subtracts-the-other-way", "6.6a/11")
class SubtractsTheOtherWay(_Alters):
    """A is taken from B."""

    opts = (Opt.SUBTRACT,)

    def altered(self, a: int, b: int) -> tuple[int, int]:
        """Swap them."""
        return b, a


@misrun("divides-the-other-way", "6.6a/11")
class DividesTheOtherWay(_Alters):
    """B is divided by A."""

    opts = (Opt.DIVIDE,)

    def altered(self, a: int, b: int) -> tuple[int, int]:
        """Swap them."""
        return b, a or 1


@misrun("subtracts-sizes-below-zero", "6.6a/11", subtle=True)
class SubtractsSizesBelowZero(_Alters):
    """Where both operands are below zero, their sizes are subtracted."""

    opts = (Opt.SUBTRACT,)

    def altered(self, a: int, b: int) -> tuple[int, int]:
        """Drop the signs."""
        return (abs(a), abs(b)) if max(a, b) < 0 else (a, b)


@misrun("forgets-what-meets-itself", "6.6a/11", subtle=True)
class ForgetsWhatMeetsItself(Run):
    """A variable that is reckoned with itself counts as 0."""

    def _operands(self, operation: Operation) -> tuple[int, int]:
        first = (operation.value_a_type, operation.value_a)
        itself = (operation.value_b_type, operation.value_b) == first
        if itself and operation.value_a_type == ValueType.VARIABLE:
            return 0, 0
        return super()._operands(operation)


@misrun("adds-bytes", "6.6a/11")
class AddsBytes(_Alters):
    """Of what is added only the lowest byte counts."""

    opts = (Opt.ADD,)

    def altered(self, a: int, b: int) -> tuple[int, int]:
        """Cut it."""
        return a, (b + 128) % 256 - 128


@misrun("multiplies-without-sign", "6.6a/11")
class MultipliesWithoutSign(_Alters):
    """Factors lose their signs."""

    opts = (Opt.MULTIPLY,)

    def altered(self, a: int, b: int) -> tuple[int, int]:
        """Drop them."""
        return abs(a), abs(b)


@misrun("multiplies-halves", "6.6a/11", subtle=True)
class MultipliesHalves(_Alters):
    """Factors are cut to 16 bits."""

    opts = (Opt.MULTIPLY,)

    def altered(self, a: int, b: int) -> tuple[int, int]:
        """Cut them."""
        return _int16(a), _int16(b)


@misrun("divides-rounding-up", "6.6a/11")
class DividesRoundingUp(_Alters):
    """Quotients are rounded up."""

    opts = (Opt.DIVIDE,)

    def altered(self, a: int, b: int) -> tuple[int, int]:
        """Make the quotient whole."""
        return (-(-a // b), 1) if b else (a, b)


@misrun("divides-rounding-to-nearest", "6.6a/11", subtle=True)
class DividesRoundingToNearest(_Alters):
    """Quotients are rounded to the nearest number, as by floats."""

    opts = (Opt.DIVIDE,)

    def altered(self, a: int, b: int) -> tuple[int, int]:
        """Make the quotient whole."""
        return (round(a / b), 1) if b else (a, b)


@misrun("divides-floats", "6.6a/11", subtle=True)
class DividesFloats(_Alters):
    """What is divided is made a float of four bytes first, so that great numbers lose digits."""

    opts = (Opt.DIVIDE,)

    def altered(self, a: int, b: int) -> tuple[int, int]:
        """Round the dividend."""
        return int(*struct.unpack("<f", struct.pack("<f", a))), b


@misrun("compares-without-sign", "6.6a/12", subtle=True)
class ComparesWithoutSign(_Alters):
    """Numbers below zero are greater than all others, as unsigned ones are."""

    opts = _COMPARING

    def altered(self, a: int, b: int) -> tuple[int, int]:
        """Take the sign for a bit."""
        return a % 2**32, b % 2**32


@misrun("not-equal-below-zero", "6.6a/12", subtle=True)
class NotEqualBelowZero(_Alters):
    """Equal numbers below zero are not as great as each other."""

    opts = (Opt.GREATER_OR_EQUAL,)

    def altered(self, a: int, b: int) -> tuple[int, int]:
        """Lower the first."""
        return (a - 1, b) if a == b < 0 else (a, b)


@misrun("compares-halves", "6.6a/12", subtle=True)
class ComparesHalves(_Alters):
    """Only the lower 16 bits are compared."""

    opts = _COMPARING

    def altered(self, a: int, b: int) -> tuple[int, int]:
        """Cut them."""
        return _int16(a), _int16(b)


@misrun("compares-the-other-way", "6.6a/12")
class ComparesTheOtherWay(_Alters):
    """B is compared with A."""

    opts = _COMPARING

    def altered(self, a: int, b: int) -> tuple[int, int]:
        """Swap them."""
        return b, a


class _TakesForAnother(Run):
    """Takes operators for others."""

    instead: ClassVar[Mapping[int, Opt]] = MappingProxyType({})

    def _meant(self, operation: Operation) -> Operation:
        return replace(operation, opt=self.instead.get(operation.opt, operation.opt))

    def _holds(self, operation: Operation) -> bool:
        return super()._holds(self._meant(operation))

    def _compute(self, operation: Operation) -> None:
        super()._compute(self._meant(operation))


@misrun("adds-where-it-multiplies", "6.6a/11")
class AddsWhereItMultiplies(_TakesForAnother):
    """Operator 3 adds."""

    instead = MappingProxyType({Opt.MULTIPLY: Opt.ADD})


@misrun("operators-as-conditions", "6.6a/12")
class OperatorsAsConditions(_TakesForAnother):
    """Operators 8 and 9 have each other's meaning, in the order of the conditions 4 and 5."""

    instead = MappingProxyType(
        {
            Opt.GREATER_OR_EQUAL: Opt.LESS_OR_EQUAL,
            Opt.LESS_OR_EQUAL: Opt.GREATER_OR_EQUAL,
        }
    )


@misrun("greater-when-equal", "6.6a/12", subtle=True)
class GreaterWhenEqual(_TakesForAnother):
    """A > B holds too when both are equal."""

    instead = MappingProxyType({Opt.GREATER: Opt.GREATER_OR_EQUAL})


@misrun("less-when-equal", "6.6a/12", subtle=True)
class LessWhenEqual(_TakesForAnother):
    """A < B holds too when both are equal."""

    instead = MappingProxyType({Opt.LESS: Opt.LESS_OR_EQUAL})


@misrun("not-less-only-when-greater", "6.6a/12", subtle=True)
class NotLessOnlyWhenGreater(_TakesForAnother):
    """A >= B does not hold when both are equal."""

    instead = MappingProxyType({Opt.GREATER_OR_EQUAL: Opt.GREATER})


@misrun("not-greater-only-when-less", "6.6a/12", subtle=True)
class NotGreaterOnlyWhenLess(_TakesForAnother):
    """A <= B does not hold when both are equal."""

    instead = MappingProxyType({Opt.LESS_OR_EQUAL: Opt.LESS})


# ---------------------------------------------------------------------- the result of a comparison


@misrun("zero-is-false", "6.6a/2", "6.5/24")
class ZeroIsFalse(Run):
    """A comparison with result 0 takes the branch of what does not hold, as in C."""

    def _holds(self, operation: Operation) -> bool:
        return not super()._holds(operation)


@misrun("inverts-what-is-above-zero", "6.6a/2", subtle=True)
class InvertsWhatIsAboveZero(Run):
    """A result above 0 inverts a comparison, one below 0 does not."""

    def _holds(self, operation: Operation) -> bool:
        return super()._holds(operation) != (operation.result > 0)


@misrun("inverts-by-the-lowest-byte", "6.6a/2", subtle=True)
class InvertsByTheLowestByte(Run):
    """A result inverts a comparison only if its lowest byte is not 0."""

    def _holds(self, operation: Operation) -> bool:
        return super()._holds(operation) != (operation.result % 256 != 0)


# ---------------------------------------------------------------------- where results go


class _Elsewhere(Run):
    """Brings results elsewhere."""

    def place(self, operation: Operation) -> Operation:
        """The operation with another place for its result."""
        return operation

    def _compute(self, operation: Operation) -> None:
        super()._compute(self.place(operation))


@misrun("keys-of-one-byte", "6.6a/13", subtle=True)
class KeysOfOneByte(_Elsewhere):
    """A result goes to the first variable whose key has the same lowest byte."""

    def place(self, operation: Operation) -> Operation:
        """Look at that byte."""
        if operation.result_type == ResultType.SET_PORT:
            return operation
        like = (key for key in self._variables if (key - operation.result) % 256 == 0)
        return replace(operation, result=next(like))


@misrun("assigns-to-the-next-variable", "6.6a/13")
class AssignsToTheNextVariable(_Elsewhere):
    """An assignment goes to the variable behind the one that it names."""

    def place(self, operation: Operation) -> Operation:
        """Go one on."""
        if operation.result_type != ResultType.ASSIGNMENT:
            return operation
        keys = list(self._variables)
        return replace(operation, result=keys[(keys.index(operation.result) + 1) % len(keys)])


@misrun("calculates-into-a", "6.6a/13")
class CalculatesIntoA(_Elsewhere):
    """A calculation is stored in the variable of its value A, where that is one."""

    def place(self, operation: Operation) -> Operation:
        """Take A's key."""
        stored = operation.result_type in (ResultType.CALCULATION, ResultType.ASSIGNMENT)
        if stored and operation.value_a_type == ValueType.VARIABLE:
            return replace(operation, result=operation.value_a)
        return operation


@misrun("ports-of-operations-from-zero", "6.6a/13")
class PortsOfOperationsFromZero(_Elsewhere):
    """An operation that sets a port sets the one above."""

    def place(self, operation: Operation) -> Operation:
        """Go one on."""
        if operation.result_type == ResultType.SET_PORT:
            return replace(operation, result=operation.result % 16 + 1)
        return operation


@misrun("operations-only-switch-on", "6.6a/13")
class OperationsOnlySwitchOn(Run):
    """An operation sets a port to 1 and never to 0."""

    def _compute(self, operation: Operation) -> None:
        if operation.result_type != ResultType.SET_PORT or self._operands(operation)[0]:
            super()._compute(operation)


@misrun("assigns-nothing", "6.6a/13")
class AssignsNothing(Run):
    """An assignment has no effect."""

    def _compute(self, operation: Operation) -> None:
        if operation.result_type != ResultType.ASSIGNMENT:
            super()._compute(operation)


@misrun("assigns-sizes", "6.6a/13", subtle=True)
class AssignsSizes(Run):
    """What is assigned loses its sign."""

    def _operands(self, operation: Operation) -> tuple[int, int]:
        a, b = super()._operands(operation)
        return (abs(a) if operation.result_type == ResultType.ASSIGNMENT else a), b


# ---------------------------------------------------------------------- what values stand for


@misrun("numbers-are-keys", "6.6a/14", subtle=True)
class NumbersAreKeys(Run):
    """A number that is the key of a variable stands for the variable."""

    def _value(self, value_type: int, value: int) -> int:
        if value_type == ValueType.NUMBER and value in self._variables:
            return self._variables[value]
        return super()._value(value_type, value)


@misrun("keys-are-numbers", "6.6a/14")
class KeysAreNumbers(Run):
    """The key of a variable stands for itself where it is value B."""

    def _operands(self, operation: Operation) -> tuple[int, int]:
        a, b = super()._operands(operation)
        return a, operation.value_b if operation.value_b_type == ValueType.VARIABLE else b


class _ReadsInputs(Run):
    """Reads something else for an input port."""

    def read(self, port: int) -> int:
        """What it reads."""
        return self._input(port)

    def _value(self, value_type: int, value: int) -> int:
        if value_type == ValueType.INPUT_PORT:
            return self.read(value)
        return super()._value(value_type, value)


@misrun("inputs-of-operations-from-zero", "6.6a/14")
class InputsOfOperationsFromZero(_ReadsInputs):
    """An operation reads the input above the one that it names."""

    def read(self, port: int) -> int:
        """Go one on."""
        return self._input(port % 8 + 1)


@misrun("inputs-inverted", "6.6a/14")
class InputsInverted(_ReadsInputs):
    """An input that is on counts as 0 and one that is off as 1."""

    def read(self, port: int) -> int:
        """Turn it round."""
        return 1 - self._input(port)


@misrun("reads-outputs-for-inputs", "6.6a/14")
class ReadsOutputsForInputs(_ReadsInputs):
    """The output port of that number is read in place of the input."""

    def read(self, port: int) -> int:
        """Read the output."""
        return int(self._plant.digital_outputs[port])


@misrun("inputs-are-numbers", "6.6a/14")
class InputsAreNumbers(_ReadsInputs):
    """The number of an input port stands for itself."""

    def read(self, port: int) -> int:
        """Read nothing."""
        return port
