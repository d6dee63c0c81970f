"""Clause 4.10: the program list (0x0B, L239-251)."""

import math
from collections import Counter
from collections.abc import Iterator
from typing import Final

from hypothesis import example
from hypothesis import strategies as st

from scaraspec.protocol.fields import NAME_MAX_BYTES, show
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.files import NameRefused, StoreFull, upload
from scaraspec.suite.engine.case import case
from scaraspec.suite.engine.connection import ReceivedFrame
from scaraspec.suite.engine.examples import given
from scaraspec.suite.engine.expectations import CaseFailed, CaseSkipped, expect, expect_in
from scaraspec.suite.engine.strategies import NAME_CHARACTERS
from scaraspec.suite.program_files.layout import layout_in_use
from scaraspec.suite.program_files.listed import (
    list_parts,
    long_name,
    names_of,
    program_names,
    store_program,
)
from scaraspec.suite.program_files.writing import program_file, wait
from scaraspec.user_message import UserMessage

_EMPTY_LIST: Final = (b"0", b"0|", b"")
"""The possible replies of an empty program store (A-4.10-4)."""
_MANY_PROGRAMS: Final = 70  # more than 64
_LENGTHS_BYTES: Final = (30, 12, 17, 30, 23)
"""Names of these lengths result in parts of every length close to the maximum."""
_NODES: Final = 258
"""This number does not fit one byte. This many nodes do not fit a buffer of 16 kilobytes."""
_TOO_LONG_BYTES: Final = 256
"""A part of this length does not fit one frame."""


def _delete(line: OutgoingConnection, name: bytes) -> None:
    reply = line.ask("delete_program", name)
    expect(
        reply.accepted,
        "a program that was just uploaded cannot be deleted",
        expected="1",
        observed=f"{reply}",
        requirement="4.11/2",
    )


def _checked_names(subject: ControllerUnderTest, line: OutgoingConnection) -> list[bytes]:
    """Request the list, check all its parts, and return the names in it."""
    parts = list_parts(subject, line)
    more = [received for received in line.sync() if received.name == "list_programs"]
    expect(
        not more,
        "another part of the list follows one that begins with 0",
        expected="no further part",
        observed="; ".join(f"{received.frame}" for received in more),
        requirement="4.10/2",
    )
    _expect_names(parts)
    return names_of(parts)


def _expect_names(parts: list[ReceivedFrame]) -> None:
    names = names_of(parts)
    observed_parts = "; ".join(f"{part}" for part in parts)
    expect(all(names), "a name in the list is empty", observed=observed_parts, requirement="4.10/7")
    duplicates = [show(name) for name, count in Counter(names).items() if count > 1]
    expect(
        not duplicates,
        "a name is in the list more than once",
        expected="once",
        observed=", ".join(duplicates),
        requirement="4.10/7",
    )


def _expect_listed(names: list[bytes], expected_names: list[bytes]) -> None:
    missing = [show(name) for name in expected_names if name not in names]
    if not missing:
        return
    joined = [show(n) for n in names if any(m in n and m != n for m in expected_names)]
    expect(
        not joined,
        "names in the list are not separated by |",
        expected=missing[0],
        observed=", ".join(joined),
        requirement="4.10/3",
    )
    all_names = b"".join(expected_names)
    split_names = [
        show(n) for n in names if n and n not in expected_names and n in all_names and n.isascii()
    ]
    expect(
        not split_names,
        "a name is not complete in one part of the list",
        expected=missing[0],
        observed=", ".join(split_names),
        requirement="4.10/6",
    )
    raise CaseFailed(
        "an uploaded program is not listed",
        expected=missing[0],
        observed=", ".join(map(show, names)),
        requirement="4.10/11",
    )


@case("4.10/2", "4.10/3", "4.10/7", "4.10/9")
def test_list(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """The list is a flag and names with separators; no name is empty or listed twice."""
    _checked_names(subject, line)


@case("4.10/8")
def test_empty(line: OutgoingConnection) -> None:
    """The list of an empty program store is the flag 0 without a name."""
    reply = line.ask("list_programs")
    if reply.value is not None and any(reply.value.names):
        raise CaseSkipped("the controller has programs that the suite may not delete")
    message = "the list of an empty program store is not the flag 0"
    expect_in(reply.frame.data.rstrip(b"\0"), _EMPTY_LIST, message)


@case("4.10/4", "4.10/2", "4.10/3", "4.10/5", "4.10/6", "4.10/7", "4.10/9", "4.10/11", name="many")
def test_many(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Each of many uploaded programs is listed, in as many parts as needed."""
    uploaded: list[bytes] = []
    before = _checked_names(subject, line)
    lengths = _lengths_that_overflow(subject, line)
    for number in range(_MANY_PROGRAMS):
        length_bytes = next(lengths, _LENGTHS_BYTES[number % len(_LENGTHS_BYTES)])
        name = long_name(subject, length_bytes)
        try:
            uploaded.append(store_program(subject, line, name))
        except StoreFull as full:
            if full.deleted not in uploaded:
                raise
            message = UserMessage(
                "the controller has room for only {number} more programs", number=number
            )
            subject.tolerate("4.10/4", "A-5-21", "full", message)
            uploaded.remove(full.deleted)
            break
        _expect_listed(_checked_names(subject, line), [*before, *uploaded])
    while uploaded:
        _delete(line, uploaded.pop(len(uploaded) // 2))
        names = _checked_names(subject, line)
        _expect_listed(names, [*before, *uploaded])
        still_listed = [show(name) for name in names if name not in before and name not in uploaded]
        expect(
            not still_listed,
            "a deleted program is still listed",
            expected="not in the list",
            observed=", ".join(still_listed),
            requirement="4.10/11",
        )


def _lengths_that_overflow(subject: ControllerUnderTest, line: OutgoingConnection) -> Iterator[int]:
    """Yield lengths of names that make one part just too long, in any order of the list.

    The later lengths depend on the list with the first name, so that separators count (A-4.10-2).
    """
    yield NAME_MAX_BYTES
    parts = list_parts(subject, line)
    remaining_bytes = _TOO_LONG_BYTES - len(parts[-1].frame.data)
    count = math.ceil(remaining_bytes / (NAME_MAX_BYTES + 1))
    for number in range(count):
        yield (remaining_bytes + number) // count - 1


@case("4.10/11", name="names")
def test_names(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A program is listed by its name from its upload to its deletion, regardless of its name."""

    @example("AZaz09_-")
    @example("AZaz09")
    @given(st.text(NAME_CHARACTERS, max_size=18))
    def store_and_delete(stem: str) -> None:
        name = subject.new_name(stem)
        try:
            store_program(subject, line, name)
        except NameRefused:
            return
        _expect_listed(program_names(subject, line), [name])
        _delete(line, name)
        expect(
            name not in program_names(subject, line),
            "a deleted program is still listed",
            expected="not in the list",
            observed=show(name),
        )

    store_and_delete()


@case("4.10/11", "4.10/2", name="another-connection")
def test_another_connection(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A program uploaded on one connection is listed on another one, regardless of its size.

    This also holds for two programs whose names have the same beginning.
    """
    name = subject.new_name()
    stem, dot, extension = name.rpartition(b".")
    longer = stem + b"a" + dot + extension
    upload(
        line, name, program_file(subject.dialect, wait(0) * _NODES, layout=layout_in_use(subject))
    )
    store_program(subject, line, longer)
    line.close()
    _expect_listed(_checked_names(subject, subject.open()), [name, longer])
