"""Program list: putting programs into it, and fetching the whole of it (4.10).

Parts are pushed, or come one for each request (A-4.10-3); which of the two it is shows with the
first list that has several.
"""

from typing import Final

from scaraspec.protocol.payloads import NameListPart
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.files import upload
from scaraspec.suite.engine.connection import ReceivedFrame
from scaraspec.suite.engine.expectations import CaseInconclusive, NoReply, expect
from scaraspec.suite.program_files.layout import short_program
from scaraspec.user_message import UserMessage

INHERITED: Final = b"__proto__"
"""A name that every object of some language has, and that no user gives to a file."""
_PUSHED_S: Final = 1.0
_MOST_PARTS: Final = 500


def long_name(subject: ControllerUnderTest, size_bytes: int) -> bytes:
    """A new name of so many bytes, or of one more than the shortest if that is more.

    It has capitals, and differs from others of its length at its end alone.
    """
    padding = size_bytes - len(subject.new_name())
    name = subject.new_name(lead=("nN" * size_bytes)[: max(padding, 1)])
    if len(name) > size_bytes and padding > 1:  # its number has one digit more
        name = subject.new_name(lead=("nN" * size_bytes)[: padding - 1])
    return name


def store_program(
    subject: ControllerUnderTest, line: OutgoingConnection, name: bytes = b""
) -> bytes:
    """Upload a program that waits for a second, under a new name if none is given; its name.

    Raises:
        CaseFailed: The subject does not take it.
    """
    name = name or subject.new_name()
    upload(line, name, short_program(subject))
    return name


def list_parts(subject: ControllerUnderTest, line: OutgoingConnection) -> list[ReceivedFrame]:
    """Every message of a list.

    Raises:
        CaseFailed: One is no part of a list.
        CaseInconclusive: It does not end.
    """
    for _ in range(_MOST_PARTS):
        if not line.listing:
            break
        _next(subject, line)  # the rest of a list of which one part was wanted
    parts = [_part(line.ask("list_programs"))]
    while parts[-1].value.more:
        if len(parts) == _MOST_PARTS:
            raise CaseInconclusive(
                UserMessage(
                    "the program list has more than {most_parts} parts", most_parts=_MOST_PARTS
                )
            )
        parts.append(_part(_next(subject, line)))
        expect(
            parts[-1].frame.data != parts[0].frame.data,
            "a list whose last part had announced another begins anew",
            expected="0 in the last part",
            observed=f"{parts[-1]}",
            requirement="4.10/4",
        )
    return parts


def names_of(parts: list[ReceivedFrame]) -> list[bytes]:
    """The names in a list, in the order in which they came."""
    return [name for part in parts for name in part.value.names]


def program_names(subject: ControllerUnderTest, line: OutgoingConnection) -> list[bytes]:
    """The names of all programs.

    Raises:
        CaseFailed: What comes is no list.
        CaseInconclusive: It does not end.
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
