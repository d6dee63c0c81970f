"""4.10: reading the program list."""

from typing import Any, Final

from hypothesis import example
from hypothesis import strategies as st

from scaraspec.protocol.fields import show
from scaraspec.suite.client.harness.client_under_test import ClientUnderTest
from scaraspec.suite.client.harness.incoming_connection import IncomingConnection
from scaraspec.suite.client.harness.operations import expect_reported, request_operation
from scaraspec.suite.client.harness.program_lists import list_parts, serve_list
from scaraspec.suite.engine.case import client_case
from scaraspec.suite.engine.examples import examples, given
from scaraspec.suite.engine.strategies import names
from scaraspec.user_message import UserMessage

_LATE_S: Final = 0.1
_MANY: Final = 400
_LONG_BYTES: Final = (29, 30, 31, 32, 64, 100, 253)
_SCRIPTED: Final = ("part[1].rob", "{b}.rob", "$c;d.rob", "007", "1e3")
"""Names that a script may take for commands, lists, variables or numbers."""
_SEEMING: Final = ("0.rob", "1.rob", "11", "0", "10.rob", "00")
"""Names that look like flags."""


def _lists(
    subject: ClientUnderTest, line: IncomingConnection, names: list[str], per_part: int, **how: Any
) -> None:
    call = subject.begin("list_programs")
    serve_list(subject, line, call, list_parts(*names, per_part=per_part), **how)
    subject.expect_result(call, names)


@client_case("4.10/1", attended=True)
def test_example(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client sends list_programs without data and reports the reply."""
    expect_reported(subject, line, "list_programs", requirement="4.10/10")


@client_case("4.10/10")
def test_parts(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client reports lists of many names that arrive in one to eight parts."""

    @example(["a.rob", "b.rob", "c.rob"], 1)
    @example([f"{number}.rob" for number in range(8)], 1)
    @given(
        st.lists(names.map(bytes.decode), min_size=1, max_size=8, unique=True), st.integers(1, 8)
    )
    def each(listed: list[str], per_part: int) -> None:
        _lists(subject, line, listed, per_part=per_part)

    each()


@client_case("4.10/10", name="late", attended=True)
def test_late_parts(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """Three parts arrive, each after a pause and the final result of an old command (3/27)."""

    def before_part() -> None:
        line.wait(_LATE_S)
        line.result("reset")

    listed = [f"pro{number}.rob" for number in range(6)]
    _lists(subject, line, listed, per_part=2, before_part=before_part)


@client_case("4.10/10", name="many")
def test_many(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """Hundreds of names arrive in full or small parts; a list without its last part fails.

    The names of that list are not in the list that the next connection brings.
    """
    listed = [f"pro{number:03}.rob" for number in range(_MANY)]
    for per_part in examples((22, 10)):  # of 11 bytes each
        _lists(subject, line, listed, per_part=per_part)
    call = subject.begin("list_programs")
    serve_list(subject, line, call, list_parts(*listed, per_part=22)[:-1])
    line.close()
    subject.expect_failure(call, requirement="T/9")
    _lists(subject, subject.open(), listed[:2], per_part=1)


@client_case("4.10/10", "T/9", name="order")
def test_order(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The names are unsorted, differ only in case, contain blanks, or look like flags."""
    _lists(subject, line, [".hidden.rob", "~a.rob", "a.rob~", "..rob"], per_part=3)
    _lists(subject, line, ["pick and place.rob", "a  b.rob"], per_part=2)
    _lists(subject, line, ["z.rob", "a.rob", "m.rob", "A.rob", "Z.ROB", "z.txt"], per_part=2)
    _lists(subject, line, list(_SEEMING), per_part=2)
    _lists(subject, line, list(_SCRIPTED), per_part=5)


@client_case("4.10/10", name="no-bar")
def test_no_bar_after_the_flag(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The reply has no bar between the flag and the first name (A-4.10-2)."""
    for per_part in examples((3, 1)):
        call = subject.begin("list_programs")
        listed = ["pro1.rob", "2.rob", "0.rob"]
        serve_list(subject, line, call, list_parts(*listed, per_part=per_part, separator=b""))
        subject.wait_for_answer(call)
        if call.ok:
            subject.expect_result(call, listed)
        else:
            subject.tolerate(
                "4.10/10", "list_prefix_sep", "0|a", "the client rejects a list without that bar"
            )


@client_case("4.10/12", attended=True)
def test_empty(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The program list is empty; the reply is the flag alone."""
    expect_reported(subject, line, "list_programs", b"0")


@client_case("4.10/12", name="readings")
def test_empty_otherwise(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The program list is empty; the reply is a flag and a bar, or has no data (A-4.10-4)."""
    for data, option in examples(((b"0|", "0|"), (b"", "empty"))):
        call, _ = request_operation(subject, line, "list_programs")
        line.reply("list_programs", data=data)
        subject.wait_for_answer(call)
        if call.ok:
            subject.expect_result(call, [])
        else:
            message = UserMessage(
                "the client rejects an empty list written as {data!r}", data=show(data)
            )
            subject.tolerate("4.10/12", "list_empty", option, message)


@client_case("4.10/12", "T/9", name="long")
def test_long_names(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client reports names of 30 bytes and more completely, up to a full part."""
    for size_bytes in examples(_LONG_BYTES):
        long = "n" * (size_bytes - 4) + ".rob"
        _lists(subject, line, [long, "a.rob"], per_part=1)
