"""Speed of the suite: in memory, where only the suite needs time, and over real links.

In memory, the limit is the time in which the virtual controller answers the same number of requests
without a judge, in the same run. A profile shows where the time of both goes.
"""

import argparse
import io
import re
import shlex
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from datetime import datetime
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from bench import peers, sampling

from scaraspec.cli import certify
from scaraspec.mutants.kill_matrix import ROLE_SUITES
from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.direction import A2C
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.readings import DEFAULT
from scaraspec.report.model import Results, Role
from scaraspec.suite.engine.plan import ALL, Options
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.plant import Plant
from scaraspec.virtual_controller.store import Store

ROUNDS: Final = 3
SCARASPEC: Final = (sys.executable, "-m", "scaraspec")
OPTIONS: Final = Options(allowed=ALL, undefined=True)
EVERYTHING: Final = ("--allow", "state,motion,destructive", "--undefined-opcodes")
EVERY_CASE: Final = ("--exhaustive",)
TRANSFER_S: Final = 1
FAST: Final = 8
"""Factor of the clock of the fast simulator."""
PATIENCE_S: Final = 10 / FAST
"""It is granted as many of its seconds for a case as any other controller is."""

PACKAGES: Final = {
    "scaraspec.judge": "judge",
    "scaraspec.traffic": "traffic",
    "scaraspec.virtual_controller": "virtual controller",
    "scaraspec.client": "client",
    "scaraspec.suite": "suite",
    "scaraspec.report": "report",
    "scaraspec.transports": "transports",
    "scaraspec.protocol": "protocol",
    "hypothesis": "hypothesis",
    "_pytest": "pytest",
    "pluggy": "pytest",
}
"""The packages that a profile of the suite in memory distinguishes."""

_HARNESS: Final = "scaraspec.suite.controller.harness"
WAITS: Final = {
    "scaraspec.suite.engine.connection.Connection.wait": "time is let pass",
    f"{_HARNESS}.controller_under_test.ControllerUnderTest.pause": "time is let pass",
    f"{_HARNESS}.access.UrlAccess.pause": "time is let pass",
    f"{_HARNESS}.outgoing_connection.OutgoingConnection.result": "a final result is awaited",
    f"{_HARNESS}.outgoing_connection.OutgoingConnection.reply": "an answer is awaited",
    f"{_HARNESS}.outgoing_connection.OutgoingConnection.sync": "an answer is awaited",
    "scaraspec.suite.engine.observer": "what passed is judged and kept",
}
"""The waits that a profile of the suite over TCP distinguishes."""

_SOON: Final = ("--transfer-timeout", f"{TRANSFER_S}")

_say = partial(print, flush=True)


def main() -> None:
    """Certify our controller and client in all ways, or print a profile."""
    parser = argparse.ArgumentParser(prog="suite", description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--profile", action="store_true", help="print a profile instead")
    profiled = parser.parse_args().profile
    with TemporaryDirectory(prefix="bench-") as name:
        folder = Path(name)
        if profiled:
            profile_in_memory()
            profile_over_tcp(folder)
            return
        for role in ROLE_SUITES:
            in_memory(role)
        over_tcp(folder)
        by_driver(folder)


def in_memory(role: Role) -> None:
    """Print cases and requests per second of processor time, in memory."""
    for _ in range(ROUNDS):
        begun_s = time.process_time()
        results = ROLE_SUITES[role].prove(OPTIONS)
        lasted_s = time.process_time() - begun_s
        requests = _requests(results)
        cases = len(results.cases)
        tried = sum(max(case.examples, 1) for case in results.cases)
        _say(
            f"{role.value} in memory: {cases} cases with {results.examples} examples, "
            f"{requests} requests, {requests / tried:.1f} each, in {lasted_s:.1f} s of one "
            f"processor: {tried / lasted_s:.0f} examples and cases of one a second, "
            f"{requests / lasted_s:.0f} requests a second, "
            f"{lasted_s / _unjudged_s(requests):.1f} times as long as unjudged"
        )


def over_tcp(folder: Path) -> None:
    """Print the duration of certifying the virtual controller over TCP, and with every case.

    And how long that of one whose seconds are shorter.
    """
    for depth in ((), EVERY_CASE):
        with _virtual_controller(folder) as url:
            out = folder / f"controller{len(depth)}"
            _certify("controller", url, *depth, *EVERYTHING, "--out", str(out))
    ics = folder / "fast.toml"
    ics.write_text(f'[subject]\nname = "virtual, {FAST} times as fast"\ntime_scale = {FAST}\n')
    with _virtual_controller(folder, FAST) as url:
        granted = ("--ics", str(ics), "--patience", f"{PATIENCE_S}")
        options = (url, *EVERYTHING, *EVERY_CASE, *granted, "--out", str(folder / "fast"))
        _say(f"a controller whose seconds are {FAST} times as short:")
        _certify("controller", *options)


def by_driver(folder: Path) -> None:
    """Print the duration of certifying the reference client."""
    driver = shlex.join((*SCARASPEC, "client-driver", *_SOON))
    _certify("client", "--driver", driver, "--out", str(folder / "client"))


def profile_in_memory() -> None:
    """Print the processor time of each package."""
    for role in ROLE_SUITES:
        with sampling.sampled(PACKAGES) as samples:
            ROLE_SUITES[role].prove(OPTIONS)
        samples.print_table(f"{role.value} in memory, in seconds of the processor")


def profile_over_tcp(folder: Path) -> None:
    """Print the waits of the suite while it certifies the virtual controller over TCP."""
    begun_s, status = time.process_time(), None
    with (
        _virtual_controller(folder) as url,
        redirect_stdout(io.StringIO()),
        sampling.sampled(WAITS, "wall") as samples,
    ):
        options = [url, *EVERYTHING, *EVERY_CASE, *_SOON, "--out", str(folder / "profiled")]
        try:
            certify.controller.command.main(options, standalone_mode=False)
        except SystemExit as ended:
            status = ended.code
    busy_s = time.process_time() - begun_s
    samples.print_table(f"certify controller over TCP, recorded, exit status {status}")
    _say(f"  {busy_s:.1f} s of the processor for the process of the suite")


@contextmanager
def _virtual_controller(folder: Path, time_scale: int = 1) -> Iterator[str]:
    """Run a virtual controller with this speed of time; yield its URL."""
    port = peers.free_port()
    where = f"{peers.HOST}:{port}"
    patient = ("--reading", f"xfer_timeout={TRANSFER_S * time_scale}")
    pace = ("--time-scale", f"{time_scale}", *patient)
    serve = [*SCARASPEC, "controller", "--listen", where, *pace]
    with peers.running(serve, port, folder / f"{port}.log"):
        yield f"tcp://{where}"


def _certify(*arguments: str) -> None:
    command = [*SCARASPEC, "certify", *arguments, *_SOON]
    begun_s = time.perf_counter()
    done = subprocess.run(command, capture_output=True, text=True, check=False)  # noqa: S603 - ours
    lasted_s = time.perf_counter() - begun_s
    printed = re.search(r"\d+ of \d+ requirements in scope judged", done.stdout)
    depth = " --exhaustive" if EVERY_CASE[0] in arguments else ""
    _say(
        f"certify {arguments[0]}{depth}, recorded: {lasted_s:.1f} s, "
        f"exit status {done.returncode}, "
        f"{printed.group() if printed else done.stderr}"
    )


def _requests(results: Results) -> int:
    assert results.session is not None
    return sum(command.count for command in results.session.exchanges)


def _unjudged_s(requests: int) -> float:
    """Return the processor time in seconds that the virtual controller needs for the requests."""
    core = ControllerCore(Plant(datetime(2026, 1, 1), 0.0), Store(), DEFAULT)  # noqa: DTZ001 - as the document
    core.open(1, 0.0, "serial")
    request = Frame(A2C, BY_NAME["get_version"].opcode, b"").encode()
    begun_s = time.process_time()
    for number in range(requests):
        core.receive(1, request, number / 1000)
    return time.process_time() - begun_s


if __name__ == "__main__":
    main()
