"""Clause 5.2: names of files with other characters than the document shows (L746, A-5-20).

A controller may refuse such a name. A name that it accepts is the name of one file.
"""

from typing import Final

from scaraspec.protocol.fields import show
from scaraspec.protocol.hazard import Hazard
from scaraspec.protocol.transfer import chunks_of
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.files import (
    delete,
    download,
    expect_stored,
    send_chunk,
    upload,
)
from scaraspec.suite.engine.case import case
from scaraspec.suite.engine.examples import examples
from scaraspec.suite.engine.expectations import expect
from scaraspec.suite.program_files.layout import short_program
from scaraspec.suite.program_files.listed import program_names
from scaraspec.user_message import UserMessage

_STATE: Final = (Hazard.STATE,)
_STEMS: Final = ("a b", "a  b", "a%b", "a%41b", "a%20b", "%s%d")
_LETTERS: Final = "name"


def _upload_if_accepted(
    subject: ControllerUnderTest, line: OutgoingConnection, name: bytes, content: bytes
) -> bool:
    """Upload a file; return whether the controller accepts its name."""
    if not line.ask("upload_name", data=name).accepted:
        message = UserMessage("the name {name} is refused", name=show(name))
        subject.tolerate("5.2/12", "A-5-20", "refused", message)
        return False
    for chunk in chunks_of(content):
        send_chunk(line, chunk)
    return True


def _expect_listed(subject: ControllerUnderTest, line: OutgoingConnection, *names: bytes) -> None:
    if "list_programs" in subject.ics.unsupported:
        return
    listed = program_names(subject, line)
    for name in names:
        expect(
            name in listed,
            UserMessage("{name} was uploaded but is not listed", name=show(name)),
            expected=show(name),
            observed=", ".join(map(show, listed)),
            requirement="4.10/11",
        )


@case("5.2/12", "4.10/11", "4.11/2", "4.11/3", name="characters", hazards=_STATE)
def test_blanks_and_percent_signs(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A file whose name has a blank or % is stored, listed and deleted under this name."""
    content = short_program(subject)
    for stem in examples(_STEMS):
        name = subject.new_name(stem)
        if not _upload_if_accepted(subject, line, name, content):
            continue
        expect_stored(line, name, content)
        _expect_listed(subject, line, name)
        delete(line, name)
        expect(
            download(line, name) is None,
            UserMessage("{name} was deleted but can be downloaded", name=show(name)),
            expected="0",
            observed="1",
            requirement="4.11/3",
        )


@case("5.2/12", "4.10/11", "4.11/2", name="letter-case", hazards=_STATE)
def test_letter_case(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Two names that differ only in case are two files, or the second one is refused."""
    name = subject.new_name(lead=_LETTERS)
    other = name.replace(_LETTERS.encode(), _LETTERS.upper().encode())
    content = short_program(subject)
    upload(line, name, content)
    accepted = _upload_if_accepted(subject, line, other, content[::-1])
    expect_stored(line, name, content)
    _expect_listed(subject, line, name)
    if accepted:
        expect_stored(line, other, content[::-1])
        delete(line, other)
        expect_stored(line, name, content)
