"""Run the client suite against the reference client in memory, unmodified or as a mutant.

The client is operated by its own driver, on an event loop with a simulated clock: time advances
only while the suite waits.
"""

import asyncio
import json
import tempfile
from collections.abc import Mapping
from contextlib import closing
from pathlib import Path
from typing import Any, Final

from scaraspec.client.aio import AsyncClient
from scaraspec.client.driver import Driver
from scaraspec.mutants.client import ClientMutant
from scaraspec.protocol.port import DEFAULT_PORT
from scaraspec.protocol.readings import READINGS, Dialect
from scaraspec.report.model import Results
from scaraspec.suite.client.harness.access import LOOPBACK
from scaraspec.suite.client.harness.adapter import ClientAdapter
from scaraspec.suite.client.harness.call import Call
from scaraspec.suite.engine.ics import Ics
from scaraspec.suite.engine.plan import Options
from scaraspec.suite.engine.run import Run
from scaraspec.transports.simulated import SimulatedLink, SimulatedLoop

_EPOCH_NS: Final = 1_767_225_600_000_000_000  # 2026-01-01
_PORT: Final = 40001


class MemoryClient:
    """The reference client in this process; see `suite.client.harness.access.Access`.

    Args:
        make: The class of the client, unmodified or faulty.
        dialect: The readings of the client.
    """

    attended = False
    real_time = False
    answer_timeout_s = 10.0
    host, port = LOOPBACK, _PORT
    connected_port = _PORT
    complaints = ""

    def __init__(self, make: type[AsyncClient], dialect: Dialect) -> None:
        self._make, self._dialect = make, dialect
        self._scratch = tempfile.TemporaryDirectory(prefix="scaraspec-")
        self.folder = Path(self._scratch.name)
        self.unmatched_lines: list[str] = []
        self._calls: dict[int, Call] = {}
        self._loop = SimulatedLoop(_EPOCH_NS)
        self._loop.ports = {_PORT}
        self._driver = self._new()

    @property
    def now_ns(self) -> int:
        """The time of the simulated clock."""
        return self._loop.time_ns

    @property
    def now_s(self) -> float:
        """The time of the simulated clock."""
        return self._loop.time()

    def begin(self, name: str, /, **values: Any) -> Call:
        """Send a request to the driver, as JSON."""
        number = len(self._calls) + 1
        call = self._calls[number] = Call(number, name, values)
        line = json.dumps({"id": number, "do": name, **values})
        self._loop.call_soon(self._driver.take, line)
        return call

    def pump(self) -> None:
        """Do nothing: the driver answers while the simulated time advances."""

    def wait(self, deadline_s: float) -> None:
        """Advance the simulated time to the deadline."""
        self._loop.run_until(max(deadline_s, self.now_s))

    def accept(self, deadline_s: float) -> SimulatedLink | None:
        """Return the next connection, or None if none is made before the deadline."""
        link = self._loop.accept(deadline_s)
        if link is not None:
            self.connected_port = link.port
        return link

    def listen_at_default(self) -> bool:
        """Also listen at port 8877."""
        self._loop.ports.add(DEFAULT_PORT)
        return True

    def ask_operator(self, sentence: str) -> Call | None:  # noqa: ARG002 - the interface has it
        """Return None: there is no operator."""
        return None

    def restart(self) -> None:
        """Replace the client and its driver with new ones."""
        self._end()
        self._driver = self._new()

    def close(self) -> None:
        """End the client and delete its files."""
        self._end()
        self._loop.close()
        self._scratch.cleanup()

    def _new(self) -> Driver:
        def make(url: str, password: str | None) -> AsyncClient:
            return self._make(url, password=password, dialect=self._dialect)

        return Driver(self._take, make)

    def _take(self, answer: Mapping[str, Any]) -> None:
        self._calls[answer["id"]].answer = json.loads(json.dumps(answer))
        self._loop.wake()

    def _end(self) -> None:
        for task in asyncio.all_tasks(self._loop):
            task.cancel()
        self._loop.run_until(self.now_s)


def prove_client(
    options: Options, fault: ClientMutant | None = None, dialect: Dialect | None = None
) -> Results:
    """Run the suite against the reference client.

    Args:
        options: Options of the run.
        fault: The mutant; None for the unmodified client.
        dialect: The readings of the client; if given, the ICS claims all readings.
    """
    used = dialect or Dialect.parse(fault.reading if fault else ())
    ics = Ics(
        name=fault.name if fault else "reference client",
        dialect=used,
        claimed=frozenset(READINGS if dialect else used.differences()),
    )
    with closing(MemoryClient(fault.wrong if fault else AsyncClient, used)) as access:
        return Run(ClientAdapter(access, ics, options, link="memory")).results()
