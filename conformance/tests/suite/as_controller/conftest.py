"""What most tests of clients do: let some of the cases be tried on a client of their own."""

from collections.abc import Callable, Mapping
from contextlib import closing

import pytest

from scaraspec.cli.prove.client import MemoryClient
from scaraspec.client import AsyncClient, ClientCore
from scaraspec.judgement.verdicts import Verdict
from scaraspec.protocol.readings import DEFAULT
from scaraspec.suite.as_controller.setting import ClientSetting
from scaraspec.suite.plan import ALL, Options
from scaraspec.suite.run import Run
from scaraspec.suite.statement import Statement


@pytest.fixture
def tried() -> Callable[..., Mapping[str, Verdict]]:
    """Let the suite try some cases on a client."""
    return _tried


def _tried(make: type[ClientCore] | type[AsyncClient], *only: str) -> Mapping[str, Verdict]:
    """What comes of the cases of these requirements."""
    shell = make if issubclass(make, AsyncClient) else type("Made", (AsyncClient,), {"core": make})
    with closing(MemoryClient(shell, DEFAULT)) as access:
        options = Options(only=frozenset(only), allowed=ALL, examples=3, exhaustive=True)
        results = Run(ClientSetting(access, Statement(), options)).results()
    return {case.id: case.verdict for case in results.cases}
