"""SIGKILL at random moments under traffic, and the bytes that are lost.

`make test-runs` tries a few kills; `make test-kill` uses the number in SCARASPEC_KILLS.
SCARASPEC_SEED repeats the same moments, if the computer is deterministic.
"""

import os
import random
import subprocess
import sys
import threading
import time
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
import rerun_cli  # type: ignore[import-untyped]  # it contains only the tool
from mcap.reader import make_reader

from scaraspec_recorder.sinks.sink import TICK_NS

pytestmark = pytest.mark.skipif(
    not hasattr(os, "pidfd_open"), reason="waits for processes by pidfd"
)

VICTIMS = {"writer": 4, "tap": 3, "all": 2, "parent": 1}
"""Weights of the processes to kill: writer, tap, whole group, parent."""

CUTTING = ("tap", "all", "parent")
"""Kills that end connections."""

LOSING = ("tap", "all")
"""Kills that may lose the latest bytes."""

OPTIONS: tuple[tuple[str, ...], ...] = ((), ("--rotate", "1s"), ("--rotate", "connection"))
LONGEST_LIFE_S = 2.0
TALKERS = 2


@dataclass
class Campaign:
    """Kills and their effects."""

    plant: Any
    dice: random.Random
    kills: list[tuple[int, str]] = field(default_factory=list)
    alone_ms: list[float] = field(default_factory=list)
    repaired: int = 0
    redrawn: int = 0
    empty: int = 0
    _begun_ns: int = 0  # the recorder itself
    _checked: set[Path] = field(default_factory=set)

    def run(self, moments: int) -> None:
        """Kill processes at this number of moments, then end in order."""
        self._start()
        self.plant.talk(TALKERS)
        pause = threading.Event()
        for _ in range(moments):
            pause.wait(self.dice.uniform(0, LONGEST_LIFE_S))
            (victim,) = self.dice.choices(list(VICTIMS), list(VICTIMS.values()))
            self.kills.append((self.plant.recorder.kill(victim), victim))
            if victim in ("all", "parent"):
                self._check_files(lossless=victim == "parent")
                self._start()
        pause.wait(LONGEST_LIFE_S)
        self.plant.stop_clients()
        self.plant.recorder.end()
        self._check_files(lossless=True)

    def losses_ms(self, recorded: Any) -> list[float]:
        """Compare the files with the bytes of the clients; return the losses of the sessions.

        It is the time from the first byte that is not recorded to the kill that caused it.
        """
        losses = []
        for session in self.plant.sessions:
            found = recorded.get(session.client, {})
            assert all(found[way].matches(session.bytes[way]) for way in found)
            assert not any(stream.lost for stream in found.values())
            held = {way: len(stream.data) for way, stream in found.items()}
            lost = (
                when
                for when, _, passed in session.answers
                if any(passed[way] > held.get(way, 0) for way in passed)
            )
            if first_ns := next(lost, None):
                losses.append(min(abs(at_ns - first_ns) for at_ns in self._when(LOSING)) / 1e6)
        return losses

    def unexplained_ends(self) -> list[Any]:
        """Return sessions with replies that ended although no kill explains it."""
        cuts, stopped_ns = self._when(CUTTING), max(s.ended_ns for s in self.plant.sessions)
        return [
            session
            for session in self.plant.sessions
            if session.answers
            and session.ended_ns < stopped_ns - LONGEST_LIFE_S * 1e9
            and not any(session.begun_ns <= cut_ns <= session.ended_ns for cut_ns in cuts)
        ]

    def report(self, losses_ms: list[float]) -> str:
        """Return the results as text."""
        sessions = self.plant.sessions
        size_bytes = sum(len(data) for session in sessions for data in session.bytes.values())
        calm, after = self._round_trips_ms()
        return "\n".join(
            (
                f"{len(self.kills)} kills: {dict(Counter(victim for _, victim in self.kills))}",
                f"{len(sessions)} sessions, {len(calm) + len(after)} exchanges, {size_bytes} bytes",
                f"lost at the end of {len(losses_ms)} sessions: {_spread(losses_ms)}",
                f"missing in the files before the next start: {_spread(self.alone_ms)}",
                f"{len(self._checked)} files: {self.repaired} repaired, {self.redrawn} redrawn",
                f"{self.empty} files that held nothing yet",
                f"round trips within 1 s after the writer's death: {_spread(after)}",
                f"all other round trips: {_spread(calm)}",
            )
        )

    def _start(self) -> None:
        self.plant.recorder.start(*self.dice.choice(OPTIONS))
        self._begun_ns = time.time_ns()

    def _when(self, victims: tuple[str, ...]) -> list[int]:
        return [at_ns for at_ns, victim in self.kills if victim in victims]

    def _check_files(self, *, lossless: bool) -> None:
        """Recover the files without a running recorder, and read them with other tools."""
        found = set(self.plant.out.glob("*.mcap")) - self._checked
        files = sorted(file for file in found if file.stat().st_size)
        self.empty += len(found) - len(files)  # their writer was killed before it wrote
        if not files:
            return
        done = subprocess.run(
            [sys.executable, "-m", "scaraspec", "recover", *map(str, files)],
            capture_output=True,
            text=True,
            check=False,
        )
        reported = done.stdout + done.stderr
        repaired = reported.count(": repaired, ")
        assert done.returncode == (3 if repaired or "unwritten" in reported else 0), reported
        assert not (lossless and done.returncode), reported
        self.repaired += repaired
        self.redrawn += reported.count(" written again")
        self._checked |= set(files)
        last_ns = self._begun_ns
        for file in files:
            with file.open("rb") as opened:
                for _, _, message in make_reader(opened).iter_messages():
                    last_ns = max(last_ns, message.log_time)
        tool = Path(rerun_cli.__file__).with_name("rerun")
        drawn = [str(file.with_suffix(".rrd")) for file in files]
        verified = subprocess.run(
            [tool, "rrd", "verify", *drawn], capture_output=True, text=True, check=False
        )
        assert verified.returncode == 0, verified.stderr
        if not lossless:
            answered_ns = [s.answers[-1][0] for s in self.plant.sessions if s.answers]
            self.alone_ms.append(max(0.0, (max(answered_ns) - last_ns) / 1e6))

    def _round_trips_ms(self) -> tuple[list[float], list[float]]:
        """Return round trips long after a kill of the writer, and those just after one."""
        deaths = self._when(("writer",))
        calm: list[float] = []
        after: list[float] = []
        for session in self.plant.sessions:
            for answered_ns, took_ns, _ in session.answers:
                near = any(0 <= answered_ns - at_ns < 1e9 for at_ns in deaths)
                (after if near else calm).append(took_ns / 1e6)
        return calm, after


def _spread(values: list[float]) -> str:
    if not values:
        return "none"
    ordered = sorted(values)
    median, high = ordered[len(ordered) // 2], ordered[len(ordered) * 99 // 100]
    return f"median {median:.2f} ms, p99 {high:.2f} ms, most {ordered[-1]:.2f} ms"


def run_campaign(plant: Any, recorded: Any, moments: int, seed: int) -> None:
    campaign = Campaign(plant, random.Random(seed))
    campaign.run(moments)
    losses_ms = campaign.losses_ms(recorded(plant.out))
    print(f"seed {seed}\n{campaign.report(losses_ms)}")  # noqa: T201 - shown by pytest -s, or if it fails
    assert not campaign.unexplained_ends()
    assert max(losses_ms, default=0) <= TICK_NS / 1e6


@pytest.mark.runs
def test_a_few_kills(plant: Any, recorded: Any) -> None:
    """At most one tick is lost, every file opens, and killing the writer ends no connection.

    With this seed each victim is killed once, and the recorder starts with each of `OPTIONS`.
    """
    run_campaign(plant, recorded, len(VICTIMS), seed=16654)


@pytest.mark.campaign
def test_many_kills(plant: Any, recorded: Any) -> None:
    """The number of kills is configurable."""
    seed = int(os.environ.get("SCARASPEC_SEED") or random.SystemRandom().randrange(1 << 32))
    run_campaign(plant, recorded, int(os.environ["SCARASPEC_KILLS"]), seed)
