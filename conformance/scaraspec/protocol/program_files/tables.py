"""The numbered tables of clause 6."""

from enum import IntEnum


class Numbered(IntEnum):
    """A table of the document that assigns meanings to numbers."""

    @classmethod
    def has(cls, number: int) -> bool:
        """Return whether the table has this number."""
        return number in cls._value2member_map_


class NodeType(Numbered):
    """The type of a node (6.5, L904-920)."""

    POINT = 1
    WAIT_INPUT = 2
    WAIT_SECONDS = 3
    SET_OUTPUT = 4
    STRAIGHT_MOVE = 5
    CURVE_MOVE = 6
    LOOP = 7
    END_LOOP = 8
    WAIT_TIMER = 9
    IF = 10
    ELSE = 11
    ENDIF = 12
    COMPUTE = 13


class PortType(Numbered):
    """The configuration of a port (6.3, L850-856); 3 and 4 are also output types (L936)."""

    UNUSED = 0
    ANALOG_INPUT = 1
    DIGITAL_INPUT = 2
    PWM_OUTPUT = 3
    DIGITAL_OUTPUT = 4


class Condition(Numbered):
    """The comparison of a wait-input node (6.5, L932): 4 is <= and 5 is >=, unlike in `Opt`."""

    GREATER = 1
    LESS = 2
    EQUAL = 3
    NOT_GREATER = 4
    NOT_LESS = 5

    def holds(self, left: float, right: float) -> bool:
        """Return whether ``left condition right`` is true; the input is on the left (A-6.5-10)."""
        match self:
            case Condition.GREATER:
                return left > right
            case Condition.LESS:
                return left < right
            case Condition.EQUAL:
                return left == right
            case Condition.NOT_GREATER:
                return left <= right
            case Condition.NOT_LESS:
                return left >= right


class ResultType(Numbered):
    """The use of the result of an operation (6.6a, L961-965)."""

    COMPARISON = 1
    CALCULATION = 2
    ASSIGNMENT = 3
    SET_PORT = 4


class ValueType(Numbered):
    """The kind of an operand (6.6a, L967-973)."""

    NONE = 0
    NUMBER = 1
    VARIABLE = 2
    INPUT_PORT = 3


class Opt(Numbered):
    """The operator of an operation (6.6a, L975-986); 0 means no operator (A-6.6a-2)."""

    ADD = 1
    SUBTRACT = 2
    MULTIPLY = 3
    DIVIDE = 4
    GREATER = 5
    LESS = 6
    EQUAL = 7
    GREATER_OR_EQUAL = 8
    LESS_OR_EQUAL = 9
