"""One run of `scaraspec certify controller` at a time can use a controller."""

import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import pytest

TIMEOUT_S = 60


class Bench(NamedTuple):
    """A controller that is in use by one run.

    Attributes:
        processes: Starts processes.
        relay: The relay between runs and controller, which forwards nothing yet.
        first: The run.
        options: The options of each run.
    """

    processes: Any
    relay: Any
    first: subprocess.Popen[str]
    options: tuple[str, ...]

    def second(self, *more: str, host: str = "127.0.0.1") -> subprocess.Popen[str]:
        """Another run against the same controller."""
        return self.processes.start(*_certify(host, self.relay), *self.options, *more)


def _certify(host: str, relay: Any) -> tuple[str, ...]:
    return ("certify", "controller", f"tcp://{host}:{relay.address[1]}")


@pytest.fixture
def bench(processes: Any, relay: Any, tmp_path: Path) -> Iterator[Bench]:
    """A run that waits for the reply to its login."""
    ics = tmp_path / "ics.toml"
    ics.write_text(f'[readings]\nreply_timeout = "{TIMEOUT_S}"\n', encoding="utf-8")
    options = ("--only", "4.8/2", "--ics", str(ics))
    with relay(processes.controller()) as one:
        one.open.clear()
        first = processes.start(*_certify("127.0.0.1", one), *options)
        assert one.arrived.acquire(timeout=TIMEOUT_S)
        yield Bench(processes, one, first, options)
        first.kill()
        first.wait(TIMEOUT_S)


def test_a_second_run(bench: Bench) -> None:
    """The second run ends with status 3 and one sentence and sends nothing; a killed run releases
    the lock."""
    second = bench.second("--wait-for-lock", "50ms", host="localhost")
    reported, _ = second.communicate(timeout=TIMEOUT_S)
    assert second.returncode == 3, reported
    *plan, sentence = reported.splitlines()
    address = "{}:{}".format(*bench.relay.address)
    assert sentence.startswith(f"scaraspec: another scaraspec run is using tcp://{address}: ")
    assert sentence.endswith("wait for it with --wait-for-lock 60s")
    assert len(plan) == 2
    assert not bench.relay.arrived.acquire(blocking=False)
    bench.relay.open.set()
    bench.first.kill()
    bench.first.wait(TIMEOUT_S)
    third = bench.second()
    reported, _ = third.communicate(timeout=TIMEOUT_S)
    assert third.returncode == 0, reported


def test_a_run_that_waits(bench: Bench) -> None:
    """With --wait-for-lock the second run starts when the first one has ended, and gives its usual
    verdict."""
    second = bench.second("--wait-for-lock", f"{TIMEOUT_S}s")
    assert second.stdout
    assert "cases will run" in second.stdout.readline()  # from now on the second run waits
    bench.relay.open.set()
    reported, _ = bench.first.communicate(timeout=TIMEOUT_S)
    assert bench.first.returncode == 0, reported
    reported, _ = second.communicate(timeout=TIMEOUT_S)
    assert second.returncode == 0, reported
