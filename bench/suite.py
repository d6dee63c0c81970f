"""How fast the suite certifies: in memory, where only it costs time, and over real links.

In memory the limit is what the virtual controller answers to the same number of requests that
nobody judges, in the same turn. What hypothesis draws is counted in a run of its own, for counting
makes it slow.
"""

import shlex
import subprocess
import sys
import time
from datetime import datetime
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

from bench import peers
from hypothesis.internal import observability

from scaraspec.cli.proofs import STANDS
from scaraspec.controller.brain import Brain
from scaraspec.controller.plant import Plant
from scaraspec.controller.store import Store
from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.direction import A2C
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.readings import DEFAULT
from scaraspec.report.model import Results, Role
from scaraspec.suite.plan import ALL, Options

ROUNDS: Final = 3
SCARASPEC: Final = (sys.executable, "-m", "scaraspec")
OPTIONS: Final = Options(allowed=ALL, undefined=True)
EVERYTHING: Final = ("--allow", "state,motion,destructive", "--undefined-opcodes")

_say = partial(print, flush=True)


def main() -> None:
    """Certify what is ours, in each way that there is."""
    for role in STANDS:
        in_memory(role)
    with TemporaryDirectory(prefix="bench-") as name:
        over_tcp(Path(name))
        by_driver(Path(name))


def in_memory(role: Role) -> None:
    """Print how many cases and requests a second of processor time takes in memory."""
    drawn = _examples(role)
    for _ in range(ROUNDS):
        begun_s = time.process_time()
        results = STANDS[role].prove(OPTIONS)
        lasted_s = time.process_time() - begun_s
        requests = _requests(results)
        cases = len(results.cases)
        _say(
            f"{role.value} in memory: {cases} cases, {drawn} drawn examples, {requests} requests "
            f"in {lasted_s:.1f} s of one processor: {(cases + drawn) / lasted_s:.0f} cases and "
            f"examples a second, {requests / lasted_s:.0f} requests a second, "
            f"{lasted_s / _unjudged_s(requests):.1f} times as long as unjudged"
        )


def over_tcp(folder: Path) -> None:
    """Print how long the virtual controller's certification takes over TCP."""
    port = peers.free_port()
    url = f"{peers.HOST}:{port}"
    serve = (*SCARASPEC, "controller", "--listen", url, "--reading", "xfer_timeout=1")
    with peers.running(list(serve), port, folder / "log"):
        _certify("controller", f"tcp://{url}", *EVERYTHING, "--out", str(folder / "controller"))


def by_driver(folder: Path) -> None:
    """Print how long the reference client's certification takes."""
    driver = shlex.join((*SCARASPEC, "client-driver", "--transfer-timeout", "1"))
    _certify("client", "--driver", driver, "--out", str(folder / "client"))


def _certify(*arguments: str) -> None:
    command = [*SCARASPEC, "certify", *arguments, "--transfer-timeout", "1"]
    begun_s = time.perf_counter()
    done = subprocess.run(command, capture_output=True, text=True, check=False)  # noqa: S603 - ours
    lasted_s = time.perf_counter() - begun_s
    _say(f"certify {arguments[0]}, recorded: {lasted_s:.1f} s, exit status {done.returncode}")


def _requests(results: Results) -> int:
    assert results.session is not None
    return sum(command.count for command in results.session.exchanges)


def _examples(role: Role) -> int:
    """How many examples hypothesis draws in one run."""
    drawn = 0

    def count(observation: Any) -> None:
        nonlocal drawn
        drawn += observation.type == "test_case"

    with observability.with_observability_callback(count):
        STANDS[role].prove(OPTIONS)
    return drawn


def _unjudged_s(requests: int) -> float:
    """What so many requests cost the virtual controller alone, in seconds of processor time."""
    brain = Brain(Plant(datetime(2026, 1, 1), 0.0), Store(), DEFAULT)  # noqa: DTZ001 - as the document
    brain.open(1, 0.0, "serial")
    request = Frame(A2C, BY_NAME["get_version"].opcode, b"").encode()
    begun_s = time.process_time()
    for number in range(requests):
        brain.receive(1, request, number / 1000)
    return time.process_time() - begun_s


if __name__ == "__main__":
    main()
