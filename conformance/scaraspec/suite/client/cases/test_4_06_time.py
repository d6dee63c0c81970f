"""4.6: reading the time."""

from datetime import datetime
from typing import Final

from hypothesis import example
from hypothesis import strategies as st

from scaraspec.suite.client.harness.client_under_test import ClientUnderTest
from scaraspec.suite.client.harness.incoming_connection import IncomingConnection
from scaraspec.suite.client.harness.operations import expect_reported
from scaraspec.suite.engine.case import client_case
from scaraspec.suite.engine.examples import examples, given

_ONE_AFTER_ANOTHER: Final = (b"20080908090808", b"20080908090809", b"20080908090909")
"""Times that differ by a second or a minute, with digits that octal numbers do not have."""

_TIMES: Final = st.datetimes(datetime(2000, 1, 1), datetime(2099, 12, 31, 23, 59, 59))  # noqa: DTZ001 - the document names no zone


@client_case("4.6/1", attended=True)
def test_example(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client sends get_time without data and reports the reply."""
    expect_reported(subject, line, "get_time", requirement="T/9")


@client_case("T/9", name="time")
def test_times(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client reports times of two centuries exactly, and never an earlier reply."""

    @example(datetime(2001, 2, 3, 4, 5, 6))  # noqa: DTZ001 - the document names no zone
    @example(datetime(1970, 1, 1))  # noqa: DTZ001 - the document names no zone
    @example(datetime(2000, 2, 29))  # noqa: DTZ001 - the document names no zone
    @example(datetime(2096, 2, 29, 12))  # noqa: DTZ001 - the document names no zone
    @example(datetime(2099, 12, 31, 23, 59, 59))  # noqa: DTZ001 - the document names no zone
    @given(_TIMES)
    def each(time: datetime) -> None:
        expect_reported(subject, line, "get_time", f"{time:%Y%m%d%H%M%S}".encode())

    each()
    for time in examples(_ONE_AFTER_ANOTHER):
        expect_reported(subject, line, "get_time", time)
