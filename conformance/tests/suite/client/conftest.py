"""Shared fixtures: run some of the cases on a client made by the test."""

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
    """Return a function that runs cases on a client and returns their results."""
    return _certified


@pytest.fixture
def tried() -> Callable[..., Mapping[str, Verdict]]:
    """Return a function that runs cases on a client and returns the verdict of each."""
    return lambda make, *only: {case.id: case.verdict for case in _certified(make, frozenset(only))}


@pytest.fixture
def wrong() -> Callable[..., dict[str, str]]:
    """Return a function that returns the messages of the cases that do not pass."""
    return lambda *given, **named: {
        case.id: case.message for case in _certified(*given, **named) if case.verdict not in GOOD
    }


def _certified(
    make: Client,
    only: frozenset[str],
    dialect: Dialect = DEFAULT,
    driver: type[Driver] = Driver,
) -> tuple[Case, ...]:
    """Return the results of these cases and of the cases of these requirements."""
    shell = make if issubclass(make, AsyncClient) else type("Made", (AsyncClient,), {"core": make})

    class Access(MemoryClient):
        def _new(self) -> Driver:
            return driver(
                self._take,
                lambda url, password: shell(url, password=password, dialect=dialect),
            )

    with closing(Access(shell, dialect)) as access:
        options = Options(only=only, cases=only, allowed=ALL, examples=3, exhaustive=True)
        results = Run(ClientAdapter(access, Ics(), options)).results()
    assert results.cases
    return results.cases
