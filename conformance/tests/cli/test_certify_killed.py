"""SIGKILL during a case of `scaraspec certify controller`: the next run restores everything.

`make test-runs` tries a few moments; `make test-kill` tries the number in SCARASPEC_KILLS.
SCARASPEC_SEED selects other moments.
"""

import itertools
import os
import random
import signal
import subprocess
import threading
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from queue import SimpleQueue
from tempfile import mkdtemp
from typing import Any, NamedTuple, Self

import pytest

from scaraspec.client import Client
from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.direction import A2C
from scaraspec.protocol.frames import Frame, Framer

pytestmark = pytest.mark.usefixtures("viewer")

TIMEOUT_S = 60
CLOCK_SLACK_S = 2
TIME_SCALE = 2
PASSWORD = "geheim-7"
ALLOWED = ("--allow", "state,motion,destructive")
PROGRAMS = Path(__file__).parents[3] / "fixtures" / "programs"
FILES = {
    "mine.rob": "pick-and-place.rob",
    "zs1.rob": "endless.rob",
    "ZSAAAA1.ROB": "left-over.rob",
    "焊接.rob": "every-node.ilp32.rob",
    "notes.txt": "README.md",  # it is not in the list
}
"""The user's files and their contents."""


class Kind(NamedTuple):
    """Where a run is killed.

    Attributes:
        only: The cases that it runs.
        request: The request before or after which it is killed.
        from_number: The first of these requests that is sent by such a case.
    """

    only: str
    request: str
    from_number: int = 1


KINDS = {
    "password": Kind("4.2", "set_password"),
    "upload": Kind("5.2/6", "upload_chunk", 6),  # after those of the probes
    "default program": Kind("4.13", "set_default_program", 2),  # after that of the start
    "network": Kind("4.4", "set_network"),
    "jog": Kind("4.28", "jog"),
    "program": Kind("4.15", "run_program"),
}
MORE_KINDS = {
    "clock": Kind("4.5", "set_time"),
    "outputs": Kind("4.32", "set_digital_output"),
    "gripper centre": Kind("4.20", "set_gripper_center"),
    "tool": Kind("4.21", "set_initial_tool_position", 2),
}
OUTS = (("none", "none"), ("one", "one"), ("one", "other"), ("one", "none"))
"""The option --out of the killed run and of the next one."""


@dataclass
class Moment:
    """When a run is killed.

    Attributes:
        request: The name of a request.
        number: The number of this request.
        further: The number of other requests after it.
        forwards: Whether the controller still receives that request.
    """

    request: str
    number: int
    further: int
    forwards: bool

    def has_come(self, frame: Frame) -> bool:
        """Return whether this is the request.

        Must be called with each request of the run in order.
        """
        if self.number:
            self.number -= frame.opcode == BY_NAME[self.request].opcode
        else:
            self.further -= 1
        return not self.number and self.further <= 0


class Gate:
    """Kills a process at a request that passes a relay."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._victims: SimpleQueue[int] = SimpleQueue()
        self._moment: Moment | None = None

    def kill(self, process: subprocess.Popen[str], moment: Moment) -> str:
        """Kill a process that will use the relay; return its output."""
        self._moment = moment
        self._victims.put(process.pid)
        out, _ = process.communicate(timeout=TIMEOUT_S)
        assert process.returncode == -signal.SIGKILL, out
        return out

    def watch(self, send: Callable[[bytes], None]) -> Callable[[bytes], None]:
        """Observe what a client sends on one connection."""
        framer = Framer(A2C)

        def take(data: bytes) -> None:
            due = self._due(framer.feed(data))
            if due is None or due.forwards:
                send(data)
            if due:
                os.kill(self._victims.get(), signal.SIGKILL)

        return take

    def _due(self, items: Iterable[object]) -> Moment | None:
        """The moment, if this is its request."""
        with self._lock:
            for frame in items:
                if self._moment and isinstance(frame, Frame) and self._moment.has_come(frame):
                    due, self._moment = self._moment, None
                    return due
        return None


@dataclass(frozen=True)
class Robot:
    """A virtual controller process with settings and files of a user.

    Attributes:
        data: Its folder.
        address: Its address.
        outputs: The outputs that were set.
        clock: A value of its clock, and the monotonic time of it on this computer.
    """

    data: Path
    address: tuple[str, int]
    outputs: str
    clock: tuple[datetime, float]

    @classmethod
    def start(cls, processes: Any, folder: Path) -> Self:
        programs, data = folder / "programs", folder / "data"
        programs.mkdir(parents=True)
        for name, source in FILES.items():
            (programs / name).write_bytes((PROGRAMS / source).read_bytes())
        address = processes.controller(
            *("--data", str(data), "--programs", str(programs)),
            *("--password", PASSWORD, "--time-scale", str(TIME_SCALE)),
        )
        with Client("tcp://{}:{}".format(*address), password=PASSWORD) as client:
            client.set_default_program("mine.rob")
            client.set_gripper_center(1, 2, 3)
            client.set_initial_tool_position(250, 10, 240, 5, 0, 0)
            client.set_network("10.1.2.3", "255.255.0.0", "10.1.0.1")
            for port in (2, 5):
                client.set_digital_output(port, 1)
            return cls(data, address, client.get_digital_outputs(), _clock(client))

    def stored(self) -> dict[str, bytes]:
        """Every file in its folder: programs, and settings.json with the password."""
        paths = (path for path in self.data.rglob("*") if path.is_file())
        return {str(path.relative_to(self.data)): path.read_bytes() for path in paths}

    def assert_as(self, stored: dict[str, bytes], *, off: bool = False) -> None:
        """Check that files, settings, outputs and clock are those of the user.

        Args:
            stored: The files.
            off: Whether the controller was shut down, after which it has no outputs and no clock.
        """
        assert self.stored() == stored
        if off:
            return
        with Client("tcp://{}:{}".format(*self.address), password=PASSWORD) as client:
            assert client.get_digital_outputs() == self.outputs
            (shown, now_s), (before, then_s) = _clock(client), self.clock
        ahead_s = (shown - before).total_seconds() - TIME_SCALE * (now_s - then_s)
        assert abs(ahead_s) <= CLOCK_SLACK_S


def _clock(client: Client) -> tuple[datetime, float]:
    """Read the clock just after it changed to the next second."""
    first = now = client.get_time()
    while now == first:
        now = client.get_time()
    return now, time.monotonic()


@dataclass(frozen=True)
class Campaign:
    """Runs against controllers, some of which are killed.

    Args:
        processes: Starts processes.
        relay: Makes relays.
        folder: The working directory.
    """

    processes: Any
    relay: Any
    folder: Path
    fresh: dict[tuple[str, ...], int] = field(default_factory=dict)

    def certify(self, url: str, *arguments: str) -> tuple[int, str]:
        """Certify without a kill; return the exit status and the output."""
        process = self.processes.start(*self.command(url, *arguments))
        out, _ = process.communicate(timeout=10 * TIMEOUT_S)
        return process.returncode, out

    def kill(
        self, kind: Kind, moment: Moment, outs: tuple[str, str], what: tuple[str, ...]
    ) -> None:
        """Kill a run at this moment, and check that the next one restores everything.

        Args:
            kind: The cases of the run.
            moment: When it is killed.
            outs: The option --out of both runs.
            what: The cases of the next run.
        """
        folder = Path(mkdtemp(dir=self.folder))
        robot = Robot.start(self.processes, folder)
        stored = robot.stored()
        first, then = (() if out == "none" else ("--out", str(folder / out)) for out in outs)
        gate = Gate()
        with self.relay(robot.address, gate.watch) as relay:
            url = "tcp://{}:{}".format(*relay.address)
            run = self.command(url, "--only", kind.only, *first)
            gate.kill(self.processes.start(*run), moment)
            status, reported = self.certify(url, *what, *then)
        assert status == self.status_of_a_fresh_controller(*what), reported
        robot.assert_as(stored, off=not what)  # the very last case shuts it down

    def status_of_a_fresh_controller(self, *what: str) -> int:
        """The exit status of such a run against a controller on which no run was killed."""
        if what not in self.fresh:
            robot = Robot.start(self.processes, self.folder / f"fresh-{len(self.fresh)}")
            with self.relay(robot.address) as relay:
                url = "tcp://{}:{}".format(*relay.address)
                self.fresh[what] = self.certify(url, *what)[0]
        return self.fresh[what]

    def command(self, url: str, *arguments: str) -> tuple[str, ...]:
        """The command line of a run."""
        ics = self.folder / "ics.toml"
        ics.write_text(f"[subject]\ntime_scale = {TIME_SCALE}\n", "utf-8")
        common = ("--ics", str(ics), "--password", PASSWORD, "--examples", "2", "--yes")
        return ("certify", "controller", url, *ALLOWED, *common, *arguments)


def dice_for(number: int) -> random.Random:
    return random.Random(f"{os.environ.get('SCARASPEC_SEED', '0')} {number}")


def a_moment(kind: Kind, dice: random.Random) -> Moment:
    number = kind.from_number + dice.randrange(3)
    return Moment(kind.request, number, dice.randrange(4), forwards=dice.random() < 0.5)


@pytest.mark.runs
def test_killed_one_after_the_other(processes: Any, relay: Any, tmp_path: Path) -> None:
    """Each run restores what the run before it left, and is killed itself; the last one passes."""
    campaign, gate = Campaign(processes, relay, tmp_path), Gate()
    robot = Robot.start(processes, tmp_path / "robot")
    stored, outs = robot.stored(), {"upload": "one", "default program": "one"}
    with relay(robot.address, gate.watch) as between:
        url = "tcp://{}:{}".format(*between.address)
        for number, (name, kind) in enumerate(KINDS.items()):
            out = ("--out", str(tmp_path / outs[name])) if name in outs else ()
            run = campaign.command(url, "--only", kind.only, *out)
            reported = gate.kill(processes.start(*run), a_moment(kind, dice_for(number)))
            assert ("was interrupted" in reported) is bool(number), reported
        status, reported = campaign.certify(url, "--only", "4.8/2")
    assert status == 0, reported
    robot.assert_as(stored)


@pytest.mark.campaign
def test_killed_again_and_again(processes: Any, relay: Any, tmp_path: Path) -> None:
    """Any number of kills, at any moment, followed by any kind of run, loses nothing."""
    campaign = Campaign(processes, relay, tmp_path)
    usual, others = itertools.cycle(KINDS.values()), itertools.cycle(MORE_KINDS.values())
    for number in range(int(os.environ.get("SCARASPEC_KILLS", "40"))):
        kind, dice = next(others if number % 4 == 3 else usual), dice_for(number)
        moment, outs = a_moment(kind, dice), dice.choice(OUTS)
        part = dice.choice(("", kind.only, kind.only, "4.8/2", "4.8/2", "4.8/2"))
        what = ("--only", part) if part else ()
        print(f"kill {number + 1}: {moment}, --out {outs}, then {what or 'all'}", flush=True)  # noqa: T201 - it takes minutes
        campaign.kill(kind, moment, outs, what)
