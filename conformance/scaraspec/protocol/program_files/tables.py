"""The numbered tables of clause 6, each met once."""

from enum import IntEnum


class Numbered(IntEnum):
    """A table of the document: numbers, each with a meaning."""

    @classmethod
    def has(cls, number: int) -> bool:
        """Whether the table has this number."""
        return number in cls._value2member_map_


class NodeType(Numbered):
    """What a node does (6.5, L904-920)."""

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
    """How a port is configured (6.3, L850-856); 3 and 4 are also the types of an output (L936)."""

    UNUSED = 0
    ANALOG_INPUT = 1
    DIGITAL_INPUT = 2
    PWM_OUTPUT = 3
    DIGITAL_OUTPUT = 4


class Condition(Numbered):
    """How a wait-input node compares (6.5, L932): 4 is <= and 5 is >=, the reverse of `Opt`."""

    GREATER = 1
    LESS = 2
    EQUAL = 3
    NOT_GREATER = 4
    NOT_LESS = 5

    def holds(self, left: float, right: float) -> bool:
        """Whether ``left condition right``, the input on the left (A-6.5-10)."""
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
    """What becomes of an operation's result (6.6a, L961-965)."""

    COMPARISON = 1
    CALCULATION = 2
    ASSIGNMENT = 3
    SET_PORT = 4


class ValueType(Numbered):
    """What an operand of an operation is (6.6a, L967-973)."""

    NONE = 0
    NUMBER = 1
    VARIABLE = 2
    INPUT_PORT = 3


class Opt(Numbered):
    """What an operation does with its operands (6.6a, L975-986); no operation is 0 (A-6.6a-2)."""

    ADD = 1
    SUBTRACT = 2
    MULTIPLY = 3
    DIVIDE = 4
    GREATER = 5
    LESS = 6
    EQUAL = 7
    GREATER_OR_EQUAL = 8
    LESS_OR_EQUAL = 9
