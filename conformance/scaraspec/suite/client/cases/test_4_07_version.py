"""4.7: reading the version."""

import re
from typing import Final

from hypothesis import example
from hypothesis import strategies as st

from scaraspec.suite.client.harness.client_under_test import ClientUnderTest
from scaraspec.suite.client.harness.incoming_connection import IncomingConnection
from scaraspec.suite.client.harness.operations import expect_reported
from scaraspec.suite.engine.case import client_case
from scaraspec.suite.engine.examples import examples, given

_numbers: Final = st.lists(st.integers(0, 9999), min_size=1, max_size=5)
_VERSIONS: Final = (
    "1",
    "1.0",
    "01.00",
    "10.20.30",
    "1.10.0",
    "1.0.0-rc1",
    "V1.0.0 build 20141222",
    "1.0.0." + "9" * 100,
    "v" * 255,
)
"""The document shows three dotted integers. Free text is tolerated (A-4.7-1)."""

_DRAWN: Final = re.compile(r"[0-9]+\.[0-9]+\.[0-9]+")


@client_case("4.7/1", attended=True)
def test_example(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client sends get_version without data and reports the reply."""
    expect_reported(subject, line, "get_version", requirement="4.7/5")


def _expect_reported(subject: ClientUnderTest, line: IncomingConnection, version: str) -> None:
    tolerated_as = None if _DRAWN.fullmatch(version) else ("A-4.7-1", "three numbers")
    expect_reported(
        subject,
        line,
        "get_version",
        version.encode(),
        requirement="4.7/5",
        tolerated_as=tolerated_as,
    )


@client_case("4.7/5")
def test_versions(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client reports versions of 1 to 255 characters unchanged."""
    for version in examples(_VERSIONS):
        _expect_reported(subject, line, version)


@client_case("4.7/5", name="numbers")
def test_numbers(subject: ClientUnderTest, line: IncomingConnection) -> None:
    """The client reports versions of one to five numbers unchanged."""

    @example([1, 0, 10])
    @given(_numbers)
    def each(numbers: list[int]) -> None:
        _expect_reported(subject, line, ".".join(map(str, numbers)))

    each()
