"""Program list: adds programs, and reads the whole list (4.10).

The controller pushes the parts of a list, or sends one part per request (A-4.10-3). The first list
with several parts shows which of the two it does.
"""

from typing import Final

from scaraspec.protocol.payloads import NameListPart
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.files import upload
from scaraspec.suite.engine.connection import ReceivedFrame
from scaraspec.suite.engine.expectations import CaseInconclusive, NoReply, expect, preparation
from scaraspec.suite.program_files.layout import short_program
from scaraspec.user_message import UserMessage

INHERITED: Final = b"__proto__"
"""A name that every JavaScript object has, and that no user gives to a file."""
_PUSHED_S: Final = 1.0
_MOST_PARTS: Final = 500


def long_name(subject: ControllerUnderTest, size_bytes: int) -> bytes:
    """Return a new name of this size, or of the minimum size plus one if that is larger.

    It has capital letters, and differs from other names of its size only at its end.
    """
    padding = size_bytes - len(subject.new_name())
    name = subject.new_name(lead=("nN" * size_bytes)[: max(padding, 1)])
    if len(name) > size_bytes and padding > 1:  # its number has one digit more
        name = subject.new_name(lead=("nN" * size_bytes)[: padding - 1])
    return name


@preparation()
def store_program(
    subject: ControllerUnderTest, line: OutgoingConnection, name: bytes = b""
) -> bytes:
    """Upload a program that waits for a second; by default under a new name.

    Returns:
        The name of the program.

    Raises:
        CaseFailed: The subject refuses the upload.
    """
    name = name or subject.new_name()
    upload(line, name, short_program(subject))
    return name


def list_parts(subject: ControllerUnderTest, line: OutgoingConnection) -> list[ReceivedFrame]:
    """Query the program list, and return all its parts.

    Raises:
        CaseFailed: A reply is not a part of a list.
        CaseInconclusive: The list does not end.
    """
    for _ in range(_MOST_PARTS):
        if not line.listing:
            break
        _next(subject, line)  # the rest of an earlier list
    parts = [_part(line.ask("list_programs"))]
    while parts[-1].value.more:
        if len(parts) == _MOST_PARTS:
            raise CaseInconclusive(
                UserMessage(
                    "the program list has more than {max_parts} parts", max_parts=_MOST_PARTS
                )
            )
        parts.append(_part(_next(subject, line)))
        expect(
            parts[-1].frame.data != parts[0].frame.data,
            "a list begins again although its last part announced another part",
            expected="0 in the last part",
            observed=f"{parts[-1]}",
            requirement="4.10/4",
        )
    return parts


def names_of(parts: list[ReceivedFrame]) -> list[bytes]:
    """Return the names in the parts of a list, in their order."""
    return [name for part in parts for name in part.value.names]


def program_names(subject: ControllerUnderTest, line: OutgoingConnection) -> list[bytes]:
    """Query the names of all programs.

    Raises:
        CaseFailed: A reply is not a part of a list.
        CaseInconclusive: The list does not end.
    """
    return names_of(list_parts(subject, line))


def _next(subject: ControllerUnderTest, line: OutgoingConnection) -> ReceivedFrame:
    if subject.dialect["list_cont"] == "push":
        try:
            return line.reply("list_programs", within_s=_PUSHED_S)
        except NoReply:
            subject.set_reading("list_cont", "request")
    return line.ask("list_programs")


def _part(answer: ReceivedFrame) -> ReceivedFrame:
    expect(
        isinstance(answer.value, NameListPart),
        "a message of the program list begins with neither 0 nor 1",
        expected="0|name|… or 1|name|…",
        observed=f"{answer}",
        requirement="4.10/2",
    )
    return answer
