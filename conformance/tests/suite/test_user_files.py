"""The files of the user are unchanged after every run, however it ends."""

import errno
import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from types import ModuleType
from typing import Any, NamedTuple

import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from scaraspec.judge.requirements import select
from scaraspec.judge.verdicts import Conclusion
from scaraspec.mutants.controller import mutants
from scaraspec.mutants.controller_run import Robot, hooks_of
from scaraspec.protocol.commands import BY_OPCODE
from scaraspec.protocol.direction import A2C
from scaraspec.protocol.frames import Frame, Framer
from scaraspec.protocol.hazard import Hazard
from scaraspec.protocol.readings import DEFAULT, Dialect
from scaraspec.report.model import Results
from scaraspec.suite.controller.harness.access import MemoryAccess
from scaraspec.suite.controller.harness.adapter import ControllerAdapter
from scaraspec.suite.controller.harness.guard import EVERYTHING, SETTINGS
from scaraspec.suite.engine import journal as journal_module
from scaraspec.suite.engine.ics import Ics
from scaraspec.suite.engine.journal import Journal, JournalError
from scaraspec.suite.engine.plan import ALL, Options
from scaraspec.suite.engine.run import Run
from scaraspec.transports.link import Arrival, Link
from scaraspec.virtual_controller.core import ControllerCore

PROGRAMS = Path(__file__).parents[3] / "fixtures" / "programs"
Only = tuple[str, ...]
SELECTIONS: tuple[Only, ...] = (
    ("4.13/3", "4.11/3", "4.12/4"),
    ("4.10/11", "4.10/2"),
    ("5.2/2", "5.2/3", "5.2/15"),
    ("4.15/4", "4.15/7"),
    ("4.2/4", "4.13/5"),
)
NAMES = (
    *(b"zs1.rob", b"zs6.rob", b"ZS2.ROB", b"zs1.txt"),  # names of earlier versions
    *(b"zsaaaa1.rob", b"ZSAAAA2.ROB", b"zsaaaa3.txt", b"zsaaaa", b"zsaaab1.rob", b"zsaaaam1.rob"),
    *(b"my program.rob", "焊接.rob".encode(), "焊接.rob".encode("gb18030"), b"pick.txt", b"a"),
)
"""Names of the user's files."""
MUTANTS = (
    *("names-are-listed-in-lower-case", "list-between-blanks", "names-beyond-twenty-are-left-out"),
    *("deletes-nothing-that-runs", "deletes-by-pattern", "list-flag-is-the-count"),
    *(
        "first-default-remains",
        "answers-names-twice",
        "cuts-names-to-thirty-bytes",
    ),
    *("overwrites-files", "uploads-outlive-their-connection", "runs-the-nearest-name"),
    *("new-password-is-forgotten", "runs-before-it-looks", "stores-names-in-latin"),
)
"""Faulty controllers that do not lose files because of their fault."""
PASSWORD = b"the user's own"


_NO_CHANGE = ("login", "delete_program", "upload_chunk", "emergency_stop")
"""Requests that change nothing that is not in the journal already."""


class KilledError(BaseException):
    """The process was killed."""


@dataclass
class InterruptionPoints:
    """Counts the points at which a run may be interrupted, and calls a function at one of them.

    Attributes:
        act_at: The number of the point; 0 for none.
        act: The function.
        dead: The process was killed; every later point raises `KilledError`.
    """

    act_at: int = 0
    act: Callable[[], None] = lambda: None
    passed: int = 0
    dead: bool = False

    def __call__(self) -> None:
        self.passed += 1
        if self.dead:
            raise KilledError
        if self.passed == self.act_at:
            self.act()

    def kill(self) -> None:
        self.dead = True
        raise KilledError


@dataclass(frozen=True)
class WatchedAccess(MemoryAccess):
    """Each frame passes a point before and after it, and is compared with the journal."""

    points: InterruptionPoints = field(default_factory=InterruptionPoints)
    journal: Path = Path()

    def connect(self) -> Link:
        self.points()
        link = super().connect()
        send, receive, framer = link.send, link.receive, Framer(A2C)

        def send_watched(data: bytes) -> int:
            self.points()
            for item in framer.feed(data):
                if isinstance(item, Frame):
                    assert_journaled(item, self.journal)
            time_ns = send(data)
            self.points()
            return time_ns

        def receive_watched(deadline_s: float, others: Sequence[Link] = ()) -> Arrival | None:
            arrival = receive(deadline_s, others)
            if arrival is not None:
                self.points()
            return arrival

        link.send, link.receive = send_watched, receive_watched  # type: ignore[method-assign]  # of this one link
        return link


def assert_journaled(frame: Frame, path: Path) -> None:
    """Assert that the journal contains what a request may change, before it is sent."""
    command = BY_OPCODE.get(frame.opcode)
    if command is None or command.hazard is Hazard.READ_ONLY or command.name in _NO_CHANGE:
        return
    changes = Journal(path).earlier
    assert changes, command.name
    if command.name == "upload_name":
        assert frame.data.decode("latin-1") in changes.offered + changes.files
    elif command.name == "set_password":
        new = frame.data.partition(b"|")[2]
        assert PASSWORD in new or new.decode("latin-1") in changes.passwords
    elif command.name in SETTINGS:
        assert {SETTINGS[command.name], EVERYTHING} & {*changes.changed}
    elif command.hazard is Hazard.MOTION:
        assert changes.motion


class WatchedJournal(Journal):
    """A journal that passes a point before and after each record.

    Args:
        path: The file.
        points: The points.
    """

    def __init__(self, path: Path, points: InterruptionPoints) -> None:
        super().__init__(path)
        self._points = points

    def write(self, event: str, **values: Any) -> None:
        self._points()
        super().write(event, **values)
        self._points()

    def confirm(self, event: str, **values: Any) -> None:
        self._points()
        super().confirm(event, **values)
        self._points()

    def finish(self) -> None:
        self._points()
        super().finish()


class FullDisk(ModuleType):
    """The module `os` with a disk that is full from one write on.

    Args:
        first_failed: The number of that write.
        partial_bytes: How many bytes of it are written.
        failures: How many writes fail.
    """

    def __init__(self, first_failed: int = 0, partial_bytes: int = 0, failures: int = 0) -> None:
        super().__init__("os")
        self._first_failed, self._partial_bytes = first_failed, partial_bytes
        self._failures, self.writes = failures, 0

    def __getattr__(self, name: str) -> Any:
        return getattr(os, name)

    def write(self, descriptor: int, data: bytes) -> int:
        self.writes += 1
        if self.writes == self._first_failed and self._partial_bytes:
            return os.write(descriptor, data[: self._partial_bytes])
        if 0 <= self.writes - self._first_failed - bool(self._partial_bytes) < self._failures:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return os.write(descriptor, data)


@dataclass(frozen=True, repr=False)
class Device:
    """A controller with files of its user.

    Attributes:
        files: The files.
        default: The name of the default program.
        robot: The controller.
    """

    files: dict[bytes, bytes]
    default: bytes
    fault: str = ""
    robot: Robot = field(init=False, repr=False)

    def __post_init__(self) -> None:
        fault = mutants()[self.fault] if self.fault else None
        dialect = Dialect.parse(fault.reading) if fault else DEFAULT
        robot = Robot(fault.wrong if fault else ControllerCore, dialect)
        for name, content in self.files.items():
            robot._store.write(name, content)
        robot._store.save(
            replace(robot._store.settings, default_program=self.default, password=PASSWORD)
        )
        object.__setattr__(self, "robot", robot)

    def __repr__(self) -> str:
        files = {name: CONTENTS.get(content, content) for name, content in self.files.items()}
        return f"<{files}, default {self.default!r}, {self.fault or 'no fault'}>"

    def assert_unchanged(self) -> None:
        """Assert that files, default program and password are those of the user."""
        store = self.robot._store
        assert {name: store.read(name) for name in store.names()} == self.files
        assert store.settings.default_program == self.default
        assert store.settings.password == PASSWORD

    def run(
        self,
        folder: str,
        only: Only,
        points: InterruptionPoints | None = None,
        token: str = "aaaa",
    ) -> Results | None:
        """Run these cases; return None if the process was killed."""
        points, path = points or InterruptionPoints(), Path(folder) / "journal"
        journal = WatchedJournal(path, points)
        tokens = iter((token, *(f"aa{a}{b}" for a in "abc" for b in "abcdefgh")))
        adapter = ControllerAdapter(
            WatchedAccess(self.robot.network, points=points, journal=path),
            Ics(hooks={"restart": hooks_of(self.robot)["restart"]}),
            PASSWORD,
            Options(only=frozenset(r.id for r in select(",".join(only))), allowed=ALL, examples=2),
            journal=journal,
            draw_token=tokens.__next__,
        )
        run = Run(adapter)
        if points.act is interrupt:
            points.act = run.interruption.ask
        try:
            with ThreadPoolExecutor(
                1
            ) as thread:  # so that the run can use hypothesis inside a hypothesis test
                return thread.submit(run.results).result()
        except BaseException:
            if not points.dead:
                raise
            for connection in [*self.robot.network._links]:
                self.robot.network.hang_up(connection)
            return None
        finally:
            journal.close()


def interrupt() -> None:
    """A placeholder for Ctrl-C."""


class RunSize(NamedTuple):
    """The number of points and of journal writes of a run without an interruption."""

    points: int
    writes: int


@cache
def run_size(only: Only) -> RunSize:
    """Return the size of a run of these cases."""
    points, disk = InterruptionPoints(), FullDisk()
    with pytest.MonkeyPatch.context() as patch, TemporaryDirectory() as folder:
        patch.setattr(journal_module, "os", disk)
        Device({b"mine.rob": b"!"}, b"").run(folder, only, points)
    return RunSize(points.passed, disk.writes)


CONTENTS = {path.read_bytes(): path.stem for path in sorted(PROGRAMS.rglob("*.rob"))}
"""Program files by their content."""


@st.composite
def devices(draw: st.DrawFn, fault: str = "") -> Device:
    """Draw controllers with some files, one of which may be the default program."""
    names = st.sampled_from(NAMES) | st.text("abzsrotx.1 试", min_size=1, max_size=9).map(
        str.encode
    )
    contents = st.sampled_from([*CONTENTS]) | st.binary(max_size=40)
    files = draw(st.dictionaries(names.filter(_is_name), contents, min_size=1, max_size=6))
    device = Device(files, b"", fault)
    programs = [name for name in files if device.robot._core.is_program(name)]
    return Device(files, draw(st.sampled_from((b"", *programs))), fault)


def _is_name(name: bytes) -> bool:
    return name not in (b".", b"..")


selections = st.sampled_from(SELECTIONS)
parts = st.integers(0, 1000)
"""The position of an event in a run, in thousandths of its points."""
tokens = st.sampled_from(("aaaa", "zzzz"))
"""The token in the file names of the next run; the first run uses the first one."""


def with_examples(examples: int) -> Callable[[Any], Any]:
    """Limit the number of examples, and do not shrink them: each one is one run or more.

    `make test-kill` tries as many as SCARASPEC_KILLS says.
    """
    return settings(
        max_examples=int(os.environ.get("SCARASPEC_KILLS", examples)),
        phases=(Phase.explicit, Phase.generate),
        suppress_health_check=[HealthCheck.too_slow],
    )


@with_examples(2)
@given(devices(), selections)
def test_normal_end(device: Device, only: Only) -> None:
    """A run that ends normally leaves the user's files unchanged and no journal."""
    with TemporaryDirectory() as folder:
        results = device.run(folder, only)
        assert results
        device.assert_unchanged()
        assert not any(Path(folder).iterdir())


@with_examples(3)
@given(devices(), selections, parts)
def test_interruption(device: Device, only: Only, part: int) -> None:
    """A run that is interrupted by Ctrl-C leaves the user's files unchanged and no journal."""
    with TemporaryDirectory() as folder:
        device.run(
            folder, only, InterruptionPoints(1 + run_size(only).points * part // 1000, interrupt)
        )
        device.assert_unchanged()
        assert not any(Path(folder).iterdir())


@with_examples(3)
@given(st.sampled_from(MUTANTS).flatmap(devices), selections)
def test_faulty_controller(device: Device, only: Only) -> None:
    """A run against a faulty controller leaves the user's files unchanged."""
    with TemporaryDirectory() as folder:
        device.run(folder, only)
        device.assert_unchanged()


@with_examples(3)
@given(devices(), selections, parts, st.integers(0, 60), st.sampled_from((1, 3, 10_000)))
def test_full_disk(
    device: Device, only: Only, part: int, partial_bytes: int, failures: int
) -> None:
    """A run whose journal cannot be written is inconclusive and restores everything."""
    disk = FullDisk(1 + run_size(only).writes * part // 1000, partial_bytes, failures)
    with TemporaryDirectory() as folder:
        with pytest.MonkeyPatch.context() as patch, suppress(JournalError):  # the run cannot start
            patch.setattr(journal_module, "os", disk)
            results = device.run(folder, only)
            assert results
            assert results.verdict is Conclusion.INCONCLUSIVE
        device.assert_unchanged()
        if any(Path(folder).iterdir()):
            device.run(folder, ("4.8/2",))
            device.assert_unchanged()
        assert not any(Path(folder).iterdir())


@with_examples(3)
@given(
    devices(), st.tuples(selections, selections), st.lists(parts, min_size=1, max_size=2), tokens
)
def test_kill(device: Device, only: tuple[Only, Only], parts: list[int], token: str) -> None:
    """The run after a killed run restores what the killed run left, whenever it was killed."""
    killed_only, next_only = only
    with TemporaryDirectory() as folder:
        for part in parts:
            points = InterruptionPoints(1 + run_size(killed_only).points * part // 1000)
            points.act = points.kill
            device.run(folder, killed_only, points)
        results = device.run(folder, next_only, token=token)
        assert results
        device.assert_unchanged()
        assert not any(Path(folder).iterdir())
