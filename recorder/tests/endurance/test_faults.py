"""Random faults of the system at random moments, and the bytes that two witnesses have seen.

Each client keeps its bytes, and a relay in front of the controller keeps those of the other end.
The recorder must not change the bytes, must record or count each, and must end within seconds.

A few faults by default; `make test-faults` uses the number in SCARASPEC_ROUNDS. SCARASPEC_SEED
repeats the same faults at about the same moments. The clock and I/O errors are those of `faults.c`:
the clock of the machine is that of other users too, and no device of it fails on request. A memory
limit is one of the address space: the kernel's own reaction to a lack of memory is a kill.
"""

import os
import random
import re
import resource
import select
import shutil
import signal
import struct
import subprocess
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from errno import EIO, EROFS
from pathlib import Path
from typing import Any

import pytest
import rerun_cli  # type: ignore[import-untyped]  # it contains only the tool
from mcap.reader import make_reader

from disk import Disk
from far_end import Bytes, FarEnd
from scaraspec.protocol.direction import A2C, C2A, Direction
from scaraspec.traffic.wire import EARLIER_FILE, Kind, WireEvent
from scaraspec_recorder.sinks.gap_filler import NOT_RECORDED
from scaraspec_recorder.sources.mcap_reader import read_mcap

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="changes processes of Linux")

END_S = 5.0
"""Limit from SIGTERM to the end; longer if other programs need the processors."""

ROUND_S = 60.0
"""Limit of a round. Most rounds take a second."""

ROUNDS_OF_EPISODE = 8
SHORT_EXCHANGES = 20
MAX_MESSAGE_BYTES = 300
LOGIN_BYTES = 12
FLUSH_NS = 500_000_000  # 20 ms, on a busy machine more
DAY_NS = 86_400_000_000_000

OPTIONS: tuple[tuple[str, ...], ...] = (
    (),
    ("--no-rrd",),
    ("--rotate", "1s", "--keep", "1h"),
    ("--rotate", "connection"),
    ("--durable",),
    ("--durable", "--rotate", "1s", "--no-rrd"),
    ("--timestamps", "kernel", "--trigger", "gap", "--on-trigger", "true"),
)

Fault = Callable[["Campaign"], Any]


def _kill(victim: str) -> Fault:
    @contextmanager
    def fault(campaign: "Campaign") -> Iterator[None]:
        campaign.kill(victim)
        yield

    return fault


def _stop(victim: str) -> Fault:
    @contextmanager
    def fault(campaign: "Campaign") -> Iterator[None]:
        pid = campaign.pid(victim)
        if pid:
            os.kill(pid, signal.SIGSTOP)
        yield
        with suppress(ProcessLookupError):
            if pid:
                os.kill(pid, signal.SIGCONT)

    return fault


def _limit(victim: str, kind: int, status: str, *, spare: int) -> Fault:
    """Limit a resource to what a process has in use, and `spare` more."""

    @contextmanager
    def fault(campaign: "Campaign") -> Iterator[None]:
        pid = campaign.pid(victim)
        used = _used(pid, status) if pid else None
        if not pid or used is None:
            yield
            return
        begun_ns = time.time_ns()
        soft, hard = resource.prlimit(pid, kind)
        resource.prlimit(pid, kind, (used + spare, hard))
        if (victim, kind) == ("parent", resource.RLIMIT_NOFILE):
            campaign.kill("writer")  # a new one needs files
        yield
        with suppress(ProcessLookupError):
            resource.prlimit(pid, kind, (soft, hard))
        if victim == "tap" and campaign.pid("tap") != pid:
            campaign.cuts.append((begun_ns, time.time_ns()))
        if (victim, kind) == ("tap", resource.RLIMIT_NOFILE):
            campaign.refusals.append((begun_ns, time.time_ns()))

    return fault


def _used(pid: int, status: str) -> int | None:
    with suppress(OSError, StopIteration):
        if status == "files":
            return 1 + max(int(path.name) for path in Path(f"/proc/{pid}/fd").iterdir())
        lines = Path(f"/proc/{pid}/status").read_text().splitlines()
        return 1024 * next(int(line.split()[1]) for line in lines if line.startswith(status))
    return None


def _system(write_errno: int = 0, sync_errno: int = 0, delay_us: int = 0) -> Fault:
    @contextmanager
    def fault(campaign: "Campaign") -> Iterator[None]:
        before = campaign.system
        campaign.set_system((before[0], write_errno, sync_errno, delay_us))
        yield
        campaign.set_system((campaign.system[0], *before[1:]))

    return fault


def _clock(step_ns: int) -> Fault:
    @contextmanager
    def fault(campaign: "Campaign") -> Iterator[None]:
        offset_ns, *errors = campaign.system
        campaign.set_system((offset_ns + step_ns, *errors))
        yield
        if campaign.dice.random() < 0.5:
            offset_ns, *errors = campaign.system
            campaign.set_system((offset_ns - step_ns, *errors))

    return fault


@contextmanager
def _full(campaign: "Campaign") -> Iterator[None]:
    campaign.disk.fill()
    yield
    campaign.disk.clear()


@contextmanager
def _read_only(campaign: "Campaign") -> Iterator[None]:
    """A file that is open for writing prevents it: it happens when a new writer starts."""
    for _ in range(200):
        try:
            campaign.disk.allow_writing(allowed=False)
            break
        except OSError:
            campaign.kill("writer")
    yield
    campaign.disk.allow_writing(allowed=True)


@contextmanager
def _removed(campaign: "Campaign") -> Iterator[None]:
    campaign.removed = True
    campaign.uncounted |= campaign.durable  # the spool, too
    shutil.rmtree(campaign.plant.out, ignore_errors=True)
    yield


FAULTS: dict[str, Fault] = {
    "kill writer": _kill("writer"),
    "stop writer": _stop("writer"),
    "stop parent": _stop("parent"),
    "stop tap": _stop("tap"),
    "disk full": _full,
    "I/O error on write": _system(write_errno=EIO),
    "I/O error on fsync": _system(sync_errno=EIO),
    "read-only file system": _system(write_errno=EROFS, sync_errno=EROFS),
    "remounted read-only": _read_only,
    "slow writer": _system(delay_us=5_000),
    "folder removed": _removed,
    "clock a day forward": _clock(DAY_NS),
    "clock a day back": _clock(-DAY_NS),
    "clock 3 s back": _clock(-DAY_NS // 28_800),
    "no files for the writer": _limit("writer", resource.RLIMIT_NOFILE, "files", spare=0),
    "no files for the tap": _limit("tap", resource.RLIMIT_NOFILE, "files", spare=0),
    "no files for the parent": _limit("parent", resource.RLIMIT_NOFILE, "files", spare=0),
    "no memory for the writer": _limit("writer", resource.RLIMIT_AS, "VmSize", spare=1 << 20),
    "no memory for the parent": _limit("parent", resource.RLIMIT_AS, "VmSize", spare=1 << 20),
}
"""Faults that must not change the bytes on the link."""

CUTTING: dict[str, Fault] = {
    "kill tap": _kill("tap"),
    "kill all": _kill("all"),
    "kill parent": _kill("parent"),
    "no memory for the tap": _limit("tap", resource.RLIMIT_AS, "VmSize", spare=1 << 16),
}
"""Faults that may end the forwarding process."""

DISK_FAULTS = (
    "disk full",
    "I/O error on write",
    "read-only file system",
    "remounted read-only",
    "folder removed",
)
"""Faults that prevent writing into the folder, also of a spool in it (`--durable`)."""

AT_THE_END = tuple(name for name in FAULTS if name != "stop parent")
"""Faults during which SIGTERM is sent. A stopped process handles no signal."""

FOREIGN = {
    "notes.txt": b"of the operator",
    "empty.mcap": b"",
    "other.mcap": b"\x89MCAP0\r\n\x01" + bytes(60),
    ".capture.rrd.new": b"draft",
    ".capture.mcap.recovered": b"",
    "2026-11-25T10-00-00Z_127.0.0.1.mcap": b"looks like a recording",
    "2026-11-25T10-00-00Z_127.0.0.1.rrd": b"",
}


class Campaign:
    """Episodes of a recorder, each with some rounds of faults.

    Args:
        plant: The controller, the recorder and the clients.
        disk: The file system of the recordings.
        far_end: The witness in front of the controller.
        folder: For files of the test.
        seed: Seed of the faults.
    """

    def __init__(self, plant: Any, disk: Disk, far_end: FarEnd, folder: Path, seed: int) -> None:
        self.plant, self.disk, self.far_end = plant, disk, far_end
        self.dice = random.Random(seed)
        self.cuts: list[tuple[int, int]] = []
        self.refusals: list[tuple[int, int]] = []
        self._ending: list[tuple[int, int | None]] = []  # time of a kill, pidfd of the process
        self.removed = self.uncounted = self.durable = False
        self.counts = Counter[str]()
        self.totals = Counter[str]()
        self.system: tuple[int, ...] = (0, 0, 0, 0)
        self.end_s: list[float] = []
        self._ended_ns = 0
        self._said: list[str] = []
        self._control = folder / "control"
        self._outside = folder / "outside.mcap"
        self._outside.write_bytes(b"of another program")
        self._pause = threading.Event()
        self.set_system(self.system)
        library = folder / "faults.so"
        source = Path(__file__).parents[1] / "support" / "faults.c"
        subprocess.run(["cc", "-shared", "-fPIC", "-O2", "-o", library, source, "-ldl"], check=True)
        plant.recorder.environment |= {
            "LD_PRELOAD": str(library),
            "FAULTS_CONTROL": str(self._control),
            "FAULTS_FOLDER": str(plant.out),
        }

    def set_system(self, system: tuple[int, ...]) -> None:
        """Change what `faults.c` does, in all processes at once."""
        self.system = system
        with self._control.open("r+b" if self._control.exists() else "wb") as file:
            file.write(struct.pack("4q", *system))

    def pid(self, victim: str) -> int | None:
        """Return the process id; None if the process does not exist."""
        recorder = self.plant.recorder
        if not recorder.running:
            return None
        return recorder.pid if victim == "parent" else recorder.find_child(victim)

    def kill(self, victim: str) -> None:
        """Kill a process, or all."""
        begun_ns, tap = time.time_ns(), self.pid("tap")
        pids = [self.pid("parent" if victim == "all" else victim)]
        if victim == "all":
            pids += [tap, self.pid("writer")]
        if victim != "writer":
            self._ending.append((begun_ns, os.pidfd_open(tap) if tap else None))
        for pid in filter(None, pids):
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        if victim in ("all", "parent"):
            self.plant.recorder.wait()

    def _wait_for_killed(self) -> None:
        """Wait until killed forwarding processes have ended, and those of a killed recorder."""
        for begun_ns, tap in self._ending:
            if tap is not None:
                assert select.select([tap], [], [], ROUND_S)[0]
                os.close(tap)
            self.cuts.append((begun_ns, time.time_ns()))
        self._ending.clear()

    def run(self, rounds: int) -> None:
        """Run rounds of faults."""
        while rounds > 0:
            self._episode(min(rounds, ROUNDS_OF_EPISODE))
            rounds -= ROUNDS_OF_EPISODE

    def _episode(self, rounds: int) -> None:
        cutting = self.dice.random() < 0.4
        options = self.dice.choice(OPTIONS)
        self.cuts, self.refusals, self.removed, self._said = [], [], False, []
        self.durable, self.uncounted = "--durable" in options, False
        self.set_system((0, 0, 0, 0))
        self.plant.out.mkdir(exist_ok=True)
        self._plant_foreign()
        first = len(self.far_end.connections)
        log_at = self.plant.log.stat().st_size if self.plant.log.exists() else 0
        self._say(f"episode with {' '.join(options) or 'no options'}")
        try:
            self.plant.recorder.start(*options)
            self.plant.talk(1)
            self.plant.talk(1, SHORT_EXCHANGES)
            lives = 1
            for _ in range(rounds):
                begun_s = time.monotonic()
                self._round(FAULTS | CUTTING if cutting else FAULTS)
                self._wait_for_killed()
                if not self.plant.recorder.running:
                    self.plant.recorder.start(*options)
                    lives += 1
                self.plant.wait_for_replies(1)
                assert time.monotonic() - begun_s < ROUND_S
            self._end(options, first_life=lives == 1)
            log = self.plant.log.read_bytes()[log_at:].decode()
            self._check(self.far_end.connections[first:], log, fresh=lives == 1)
        except BaseException:
            print("\n".join(self._said))  # noqa: T201 - shown if it fails
            raise
        self.plant.talkers.clear()
        shutil.rmtree(self.plant.out)

    def _round(self, faults: dict[str, Fault]) -> None:
        self._pause.wait(self.dice.uniform(0, 0.5))
        with ExitStack() as active:
            for _ in range(self.dice.choices((1, 2), (7, 3))[0]):
                self._begin(self.dice.choice(list(faults)), active)
                self._pause.wait(self.dice.uniform(0, 0.6))

    def _begin(self, name: str, active: ExitStack) -> None:
        self.counts[name] += 1
        self._say(name)
        active.enter_context((FAULTS | CUTTING)[name](self))
        active.callback(self._say, f"end of {name}")

    def _end(self, options: tuple[str, ...], *, first_life: bool) -> None:
        """End by SIGTERM, perhaps during a fault or under traffic; then write the rest."""
        talking = self.dice.random() < 0.5
        if not talking:
            self.plant.stop_clients()
        with ExitStack() as active:
            if self.dice.random() < 0.6:
                name = self.dice.choice(AT_THE_END)
                self._begin(name, active)
                self._pause.wait(self.dice.uniform(0, 0.3))
                # The last counts of a spool that cannot be written are a gap of unknown length.
                self.uncounted |= self.durable and name in DISK_FAULTS
            begun_s, self._ended_ns = time.monotonic(), time.time_ns()
            status = self.plant.recorder.end(signal.SIGTERM)
            took_s = time.monotonic() - begun_s
            self._say(f"ended with {status} after {took_s:.1f} s")
            self.end_s.append(took_s)
        lost = first_life and self.removed and self.durable
        assert status == 3 if lost else status in (0, 3)
        self.totals["late ends"] += took_s > END_S
        assert took_s < END_S * max(1.0, os.getloadavg()[0] / (os.cpu_count() or 1))
        if "is incomplete: start the recorder again" in self.plant.log.read_text()[-400:]:
            assert status == 3
            self.totals["ends with a rest"] += 1
            self.plant.recorder.start(*options)
            self.plant.recorder.end(signal.SIGTERM)
        if talking:
            self.plant.stop_clients()

    def _check(self, far: list[Bytes], log: str, *, fresh: bool) -> None:
        assert "Traceback" not in log
        assert "has a defect" not in log
        self._check_files()
        recorded = read(self.plant.out)
        received, found = Counter[Direction](), Counter[Direction]()
        # Those without replies last: they are the most alike.
        for session in sorted(self.plant.sessions, key=lambda each: -len(each.bytes[C2A])):
            other = _other_end(session, far)
            near, streams = session.bytes, recorded.get(session.client, {})
            harmed = _overlaps(session, self.cuts)
            last = not session.complete and session.ended_ns > self._ended_ns
            if not session.answers and (last or harmed or _overlaps(session, self.refusals)):
                # Perhaps it had no connection to the controller; then `other` is another session.
                streams.get(A2C, _EMPTY).check(near[A2C])
            else:
                if last:  # the recorder ended before the last message of each side
                    for sender, receiver, way in ((near, other, A2C), (other, near, C2A)):
                        assert len(sender[way]) - len(receiver[way]) <= MAX_MESSAGE_BYTES
                        del sender[way][len(receiver[way]) :]
                self._check_session(session, other, streams, harmed=harmed)
            received += Counter({A2C: len(other[A2C]), C2A: len(session.bytes[C2A])})
            for way in Direction:
                found[way] += streams.get(way, _EMPTY).recorded_bytes
            self.totals["harmed sessions"] += harmed
        self.totals.update(sessions=len(self.plant.sessions), bytes=received.total())
        if fresh and not self.cuts and not self.uncounted:
            self.totals["exact accounts"] += 1
            accounts = _accounts(log)
            assert [a for a, _, _ in accounts] == [received[way] for way in Direction]
            for total, written, lost in accounts:
                assert total == written + lost
                self.totals["lost bytes"] += lost
            written_bytes = [written for _, written, _ in accounts]
            found_bytes = [found[way] for way in Direction]
            if self.removed:  # complete files, too
                assert all(a >= b for a, b in zip(written_bytes, found_bytes, strict=True))
            else:
                assert written_bytes == found_bytes

    def _check_session(
        self, session: Any, other: Bytes, recorded: dict[Direction, "Stream"], *, harmed: bool
    ) -> None:
        near = session.bytes
        assert near[A2C].startswith(other[A2C])
        assert other[C2A].startswith(near[C2A])
        # The last records of the forwarding process are lost with it.
        unflushed = [(begin_ns - FLUSH_NS, end_ns) for begin_ns, end_ns in self.cuts]
        uncounted = self.removed or self.uncounted or _overlaps(session, unflushed)
        sizes = {way: (len(other[way]), len(near[way])) for way in Direction}
        assert harmed or other == near, (session.client, sizes, session.complete)
        for way, sent in ((A2C, near[A2C]), (C2A, other[C2A])):
            stream = recorded.get(way, _EMPTY)
            stream.check(sent)
            passed_bytes = len(other[A2C] if way is A2C else near[C2A])
            if not uncounted:
                assert stream.end_bytes == passed_bytes, (session.client, way)

    def _check_files(self) -> None:
        """Nothing foreign is changed, and other tools read every file."""
        for name, data in (*FOREIGN.items(), ("link.mcap", self._outside.read_bytes())):
            path = self.plant.out / name
            if path.exists() or not self.removed:
                assert path.read_bytes() == data, name
                assert path.is_symlink() == (name == "link.mcap")
                path.unlink()
        assert self._outside.read_bytes() == b"of another program"
        # A file is empty if its writer was killed before it wrote.
        files = [file for file in self.plant.out.glob("*.mcap") if file.stat().st_size]
        if not files:
            return
        alone = [
            file
            for file in self.plant.out.glob("*.rrd")
            if file.stat().st_size and not file.with_suffix(".mcap").exists()
        ]
        subprocess.run(
            [sys.executable, "-m", "scaraspec", "recover", *map(str, (*files, *alone))],
            capture_output=True,
            check=False,
        )
        for file in files:
            with file.open("rb") as opened:
                reader = make_reader(opened, validate_crcs=True)
                for _ in reader.iter_messages():
                    pass
        drawn = [str(file) for file in self.plant.out.glob("*.rrd")]
        if not self.removed:  # which may happen between the creation of two files
            captures = {file.stem for file in self.plant.out.glob("*.mcap")}
            assert {Path(file).stem for file in drawn} <= captures
        assert {file.stem for file in files} <= {Path(file).stem for file in drawn}
        tool = Path(rerun_cli.__file__).with_name("rerun")
        subprocess.run([tool, "rrd", "verify", *drawn], capture_output=True, check=True)
        self.totals["files"] += len(files) + len(drawn)

    def _plant_foreign(self) -> None:
        for name, data in FOREIGN.items():
            (self.plant.out / name).write_bytes(data)
        (self.plant.out / "link.mcap").symlink_to(self._outside)

    def _say(self, text: str) -> None:
        self._said.append(f"{time.time():.3f} {text}")


class Stream:
    """The recorded pieces and gaps of one direction of a session, from all files."""

    def __init__(self) -> None:
        self._pieces: list[tuple[int, int, bytes | None]] = []

    def add(self, event: WireEvent) -> None:
        begin, data = event.offset_bytes, event.data
        if event.kind is Kind.BYTES:
            self._pieces.append((begin, begin + len(data), data))
        elif event.length_bytes > 0 and event.note not in UNACCOUNTED:
            self._pieces.append((begin, begin + event.length_bytes, None))

    def check(self, sent: bytearray) -> None:
        """Compare the pieces with the bytes of the sender."""
        for begin, end, data in self._pieces:
            assert data is None or data == sent[begin:end]

    @property
    def end_bytes(self) -> int:
        """The end of the bytes that are recorded or counted as lost, without a hole."""
        reached = 0
        for begin, end, _ in sorted(self._pieces, key=lambda piece: piece[:2]):
            if begin > reached:
                break
            reached = max(reached, end)
        return reached

    @property
    def recorded_bytes(self) -> int:
        """The number of recorded bytes. Those in two files count once."""
        reached = total = 0
        for begin, end, data in sorted(self._pieces, key=lambda piece: piece[:2]):
            if data is not None:
                total += max(end - max(begin, reached), 0)
                reached = max(reached, end)
        return total


UNACCOUNTED = (EARLIER_FILE, NOT_RECORDED)
_EMPTY = Stream()


def read(out: Path) -> dict[str, dict[Direction, Stream]]:
    """Return what the files of a folder contain of each client."""
    found: dict[str, dict[Direction, Stream]] = {}
    for file in out.glob("*.mcap"):
        if not file.stat().st_size:
            continue
        clients: dict[str, str] = {}
        for event in read_mcap(file):
            if event.kind is Kind.OPENED:
                clients[event.connection] = event.note.partition(" > ")[0]
            elif event.kind in (Kind.BYTES, Kind.GAP):
                streams = found.setdefault(
                    clients[event.connection], {way: Stream() for way in Direction}
                )
                streams[event.direction].add(event)
    return found


def _overlaps(session: Any, spans: list[tuple[int, int]]) -> bool:
    return any(session.begun_ns <= end and session.ended_ns >= begin for begin, end in spans)


def _other_end(session: Any, far: list[Bytes]) -> Bytes:
    """Return the bytes of a session at the controller, and remove them from the list.

    A name in the second request is unique. Sessions that end before it are alike.
    """
    sent, received = bytes(session.bytes[A2C]), session.bytes[C2A]

    def likelihood(other: Bytes) -> tuple[bool, bool]:
        return len(other[A2C]) > LOGIN_BYTES, bool(other[C2A]) == bool(received)

    candidates = [other for other in far if sent.startswith(other[A2C])]
    found = max(candidates, key=likelihood, default={A2C: bytearray(), C2A: bytearray()})
    far[:] = [other for other in far if other is not found]
    return found


def _accounts(log: str) -> list[tuple[int, int, int]]:
    """Return received, recorded and missing bytes of each direction in the last summary."""
    words = r"(\d+) bytes received and forwarded = (\d+) recorded \+ (\d+) in \d+ gaps"
    received, recorded, lost = zip(*re.findall(words, log)[-2:], strict=True)
    return [(int(a), int(b), int(c)) for a, b, c in zip(received, recorded, lost, strict=True)]


def run_campaign(plant: Any, tmp_path: Path, rounds: int, seed: int) -> None:
    folder = tmp_path / "disk"
    folder.mkdir()
    disk = Disk(folder)
    plant.recorder.out = folder / "out"
    host, port = plant.recorder.url.removeprefix("tcp://").split(":")
    with FarEnd((host, int(port))) as far_end:
        plant.recorder.url = "tcp://{}:{}".format(*far_end.address)
        campaign = Campaign(plant, disk, far_end, tmp_path, seed)
        print(f"SCARASPEC_SEED={seed} SCARASPEC_ROUNDS={rounds}", flush=True)  # noqa: T201 - as below
        begun_s = time.monotonic()
        campaign.run(rounds)
    took_s = time.monotonic() - begun_s
    print(f"{rounds} rounds in {took_s:.0f} s: {dict(campaign.counts)}")  # noqa: T201 - shown by pytest -s, or if it fails
    print(f"{dict(campaign.totals)}; ended within {max(campaign.end_s):.1f} s")  # noqa: T201 - as above


@pytest.mark.network
def test_a_few_faults(plant: Any, tmp_path: Path) -> None:
    """The bytes pass unchanged, and all are recorded or counted."""
    run_campaign(plant, tmp_path, ROUNDS_OF_EPISODE, seed=1)


@pytest.mark.campaign
def test_many_faults(plant: Any, tmp_path: Path) -> None:
    """The number of rounds is configurable."""
    seed = int(os.environ.get("SCARASPEC_SEED") or random.SystemRandom().randrange(1 << 32))
    run_campaign(plant, tmp_path, int(os.environ["SCARASPEC_ROUNDS"]), seed)
