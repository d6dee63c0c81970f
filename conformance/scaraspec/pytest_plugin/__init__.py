"""The pytest plugin: certifies a controller in a team's own pytest session.

    pytest --scaraspec-certify --scaraspec-subject tcp://192.168.1.2

Every pytest session in an environment with scaraspec loads this module. Without the options it
does nothing else: it imports only the vocabulary, and everything more on demand.
"""

from collections.abc import Iterator
from typing import TYPE_CHECKING

import pytest

from scaraspec.cli.vocabulary import WORDS

if TYPE_CHECKING:
    from scaraspec.client import Client


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options of ``scaraspec certify controller``, with a prefix."""
    group = parser.getgroup("scaraspec", "certify a controller of the UISR4200S protocol")
    group.addoption(
        "--scaraspec-certify",
        action="store_true",
        help="Run the cases of scaraspec after the other tests.",
    )
    group.addoption(
        "--scaraspec-subject",
        metavar="URL",
        help="The controller, such as tcp://192.168.1.2 [url in the ICS file].",
    )
    for word in WORDS.values():
        shown = "" if word.default is None else f" [default: {word.default}]"
        text = f"{word.help}{shown}".replace("%", "%%")
        if word.metavar is None:
            group.addoption(f"--scaraspec-{word.name}", action="store_true", help=text)
        else:
            group.addoption(f"--scaraspec-{word.name}", metavar=word.metavar, help=text)


def pytest_configure(config: pytest.Config) -> None:
    """Prepare a certification if the command line asks for one.

    Raises:
        pytest.UsageError: An option is wrong, or no controller is named.
    """
    config.addinivalue_line("markers", "scaraspec_case(case): a case of scaraspec")
    if config.getoption("--scaraspec-certify"):
        from scaraspec.pytest_plugin.certification import prepare  # noqa: PLC0415 - see the module

        prepare(config)


@pytest.fixture
def scaraspec_subject(pytestconfig: pytest.Config) -> Iterator["Client"]:
    """The controller that ``--scaraspec-subject`` names: a connected `scaraspec.client.Client`.

    It is logged in over TCP, and closed after the test. Tests with this fixture run before the
    cases of scaraspec, and with pytest-xdist on the same worker: a second client at the same time
    would disturb the cases.
    """
    from scaraspec.pytest_plugin.client import connect  # noqa: PLC0415 - see the module

    with connect(pytestconfig) as client:
        yield client
