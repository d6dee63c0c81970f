"""Valid bytes: which requirement is violated by bytes of a client that are not a frame."""

from collections.abc import Mapping
from typing import Final

from scaraspec.judge.rules.diagnosis import Diagnosis, Fault, diagnose
from scaraspec.protocol.commands import BY_OPCODE
from scaraspec.protocol.fields import show
from scaraspec.suite.engine.connection import Connection
from scaraspec.suite.engine.expectations import CaseFailed
from scaraspec.traffic.events import InvalidBytes
from scaraspec.user_message import UserMessage

_FRAMING_REQUIREMENTS: Final[Mapping[Fault, str]] = {
    Fault.STRAY: "3/32",
    Fault.START: "3/2",
    Fault.TAG: "3/15",
    Fault.END: "3/3",
}
_SHORTEST_BYTES: Final = 4  # start, opcode, length, end


def expect_valid_bytes(line: Connection, *, length_requirement: str = "3/7") -> None:
    """Require that the client sent no invalid bytes and no undefined opcode.

    Args:
        line: The connection.
        length_requirement: The requirement that a wrong length violates.

    Raises:
        CaseFailed: The client sent such bytes or such an opcode.
    """
    line.flush()
    for noise in line.invalid_bytes:
        diagnosis = diagnose(noise)
        unfinished = diagnosis.fault is Fault.NONE
        raise CaseFailed(
            UserMessage(
                "the client sent invalid bytes: {fault}",
                fault="an unfinished frame" if unfinished else diagnosis.fault.value,
            ),
            expected=diagnosis.expected or "start, opcode, length, data, end",
            observed=f"{show(noise.data)} ({noise.data[:20].hex(' ').upper()})",
            requirement=_violated(noise, diagnosis, length_requirement),
        )
    for seen in line.inbox:
        if seen.frame.opcode not in BY_OPCODE:
            raise CaseFailed(
                "the client sent an undefined opcode",
                expected="an opcode of clauses 4 and 5",
                observed=f"{seen.frame}",
                requirement="3/10",
            )


def _violated(noise: InvalidBytes, diagnosis: Diagnosis, length_requirement: str) -> str:
    """Return the requirement that the invalid bytes violate."""
    match diagnosis.fault:
        case Fault.LENGTH:
            wraps = not diagnosis.surplus_bytes % 256
            return "3/8" if diagnosis.observed == "0" else "3/28" if wraps else length_requirement
        case Fault.NONE if len(noise.data) >= _SHORTEST_BYTES:  # the length byte is too large
            return length_requirement
    return _FRAMING_REQUIREMENTS.get(diagnosis.fault, "3/1")
