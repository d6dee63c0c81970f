"""The fixture ``scaraspec_subject``: a client of the controller for the tests of a team."""

import pytest

from scaraspec.client import Client
from scaraspec.pytest_plugin.settings import PREFIX, read
from scaraspec.transports.url import parse


def connect(config: pytest.Config) -> Client:
    """Return a client of the controller that the options of the session name; a context.

    Raises:
        pytest.UsageError: No controller is named, or an option is wrong.
    """
    given = read(config)
    if not given.url:
        raise pytest.UsageError(f"no controller: name it with {PREFIX}subject URL")
    password = given.settings.password if parse(given.url).needs_login else None
    return Client(given.url, password=password, dialect=given.statement.dialect)
