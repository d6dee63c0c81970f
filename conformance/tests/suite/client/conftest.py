"""What most tests of clients do: let some of the cases be tried on a client of their own."""

from collections.abc import Callable, Mapping
from contextlib import closing

import pytest

from scaraspec.client import AsyncClient, ClientCore
from scaraspec.client.driver import Driver
from scaraspec.judge.verdicts import Verdict
from scaraspec.mutants.client_run import MemoryClient
from scaraspec.protocol.readings import DEFAULT, Dialect
from scaraspec.report.model import Case
from scaraspec.suite.client.harness.adapter import ClientAdapter
from scaraspec.suite.engine.ics import Ics
from scaraspec.suite.engine.plan import ALL, Options
from scaraspec.suite.engine.run import Run

Client = type[AsyncClient] | type[ClientCore]
GOOD = (Verdict.PASS, Verdict.TOLERATED)


@pytest.fixture
def certified() -> Callable[..., tuple[Case, ...]]:
    """Let the suite try some cases on a client."""
    return _certified


@pytest.fixture
def tried() -> Callable[..., Mapping[str, Verdict]]:
    """The same, and what comes of each."""
    return lambda make, *only: {case.id: case.verdict for case in _certified(make, frozenset(only))}


@pytest.fixture
def wrong() -> Callable[..., dict[str, str]]:
    """The same, and which neither pass nor are tolerated."""
    return lambda *given, **named: {
        case.id: case.message for case in _certified(*given, **named) if case.verdict not in GOOD
    }


def _certified(
    make: Client,
    only: frozenset[str],
    dialect: Dialect = DEFAULT,
    driver: type[Driver] = Driver,
) -> tuple[Case, ...]:
    """What came of the cases of these requirements."""
    shell = make if issubclass(make, AsyncClient) else type("Made", (AsyncClient,), {"core": make})

    class Access(MemoryClient):
        def _new(self) -> Driver:
            return driver(
                self._take,
                lambda url, password: shell(url, password=password, dialect=dialect),
            )

    with closing(Access(shell, dialect)) as access:
        options = Options(only=only, allowed=ALL, examples=3, exhaustive=True)
        results = Run(ClientAdapter(access, Ics(), options)).results()
    assert results.cases
    return results.cases
