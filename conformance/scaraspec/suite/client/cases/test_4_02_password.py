"""4.2: setting a new password."""

from typing import Final

from hypothesis import example
from hypothesis import strategies as st

from scaraspec.protocol.commands import PasswordChange
from scaraspec.suite.client.harness.client_under_test import ClientUnderTest
from scaraspec.suite.client.harness.incoming_connection import IncomingConnection
from scaraspec.suite.client.harness.operations import expect_local_refusal, request_operation
from scaraspec.suite.engine.case import client_case
from scaraspec.suite.engine.examples import examples, given

_PRINTABLE: Final = st.characters(min_codepoint=0x21, max_codepoint=0x7E, exclude_characters="|\"'")
_passwords: Final = st.text(_PRINTABLE, min_size=1, max_size=30).map(str.encode)
_BARRED: Final = (
    PasswordChange(b"old", b"new|er"),
    PasswordChange(b"old|er", b"new"),
    PasswordChange(b"|", b"new"),
    PasswordChange(b"old", b"new|"),
)
_TOO_LONG_BYTES: Final = ((127, 128), (128, 127), (1, 254), (254, 1), (200, 200), (255, 255))
_WIDE: Final = PasswordChange(("旧" * 60).encode(), ("新" * 70).encode())
"""131 characters with the bar between them. Too long in UTF-8 and in GB18030 (A-T-2)."""


@client_case("4.2/1", attended=True)
def test_example(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """Setting the password is refused once and then accepted."""
    call, _ = request_operation(subject, line, "set_password")
    line.reply("set_password", data=b"0")
    subject.expect_failure(call)
    call, _ = request_operation(subject, line, "set_password")
    line.reply("set_password", data=b"1")
    subject.expect_done(call)


@client_case("4.2/1", name="pairs")
def test_pairs(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client sends pairs of passwords completely, the old password first."""

    @example(b"o" * 60, b"n" * 60)
    @example(b"x", b"x")
    @example(b"50%s%%", b"100%%")
    @example(b" old word ", b" new word ")
    @given(_passwords, _passwords)
    def each(old: bytes, new: bytes) -> None:
        with subject.allow_refusal():
            call, _ = request_operation(subject, line, "set_password", PasswordChange(old, new))
            line.reply("set_password", data=b"1")
            subject.expect_done(call)

    each()


@client_case("4.2/7")
def test_bars(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client refuses an old or new password that contains a bar."""
    for pair in examples(_BARRED):
        expect_local_refusal(subject, line, "set_password", pair)


@client_case("4.2/7", name="long")
def test_too_long(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client refuses password pairs of more than 255 bytes, also with fewer characters."""
    for old, new in examples(_TOO_LONG_BYTES):
        expect_local_refusal(subject, line, "set_password", PasswordChange(b"o" * old, b"n" * new))
    expect_local_refusal(subject, line, "set_password", _WIDE)
