"""The user's files survive every run, however it ends."""

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
    *(b"zs1.rob", b"zs6.rob", b"ZS2.ROB", b"zs1.txt"),  # as earlier versions named their files
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
"""Faulty controllers that lose no file by themselves."""
PASSWORD = b"the user's own"


_NO_CHANGE = ("login", "delete_program", "upload_chunk", "emergency_stop")
"""Requests that change nothing that is not written down already."""


class KilledError(BaseException):
    """The process is gone."""


@dataclass
class Moments:
    """Counts the points at which a run may be interrupted, and acts at one of them.

    Attributes:
        at: The point; it never comes if that is 0.
        act: What happens then.
        dead: The process is gone: at every later point it is still gone.
    """

    at: int = 0
    act: Callable[[], None] = lambda: None
    passed: int = 0
    dead: bool = False

    def __call__(self) -> None:
        self.passed += 1
        if self.dead:
            raise KilledError
        if self.passed == self.at:
            self.act()

    def kill(self) -> None:
        self.dead = True
        raise KilledError


@dataclass(frozen=True)
class WatchedAccess(MemoryAccess):
    """Every frame passes a point before and after it, and is compared with the journal."""

    moments: Moments = field(default_factory=Moments)
    journal: Path = Path()

    def connect(self) -> Link:
        self.moments()
        link = super().connect()
        send, receive, framer = link.send, link.receive, Framer(A2C)

        def sent(data: bytes) -> int:
            self.moments()
            for item in framer.feed(data):
                if isinstance(item, Frame):
                    assert_written_down(item, self.journal)
            time_ns = send(data)
            self.moments()
            return time_ns

        def received(deadline_s: float, others: Sequence[Link] = ()) -> Arrival | None:
            arrival = receive(deadline_s, others)
            if arrival is not None:
                self.moments()
            return arrival

        link.send, link.receive = sent, received  # type: ignore[method-assign]  # of this one link
        return link


def assert_written_down(frame: Frame, path: Path) -> None:
    """What a request may change is in the journal before it is sent."""
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
    """Passes a point before and after each record.

    Args:
        path: The file.
        moments: The points.
    """

    def __init__(self, path: Path, moments: Moments) -> None:
        super().__init__(path)
        self._moments = moments

    def write(self, event: str, **values: Any) -> None:
        self._moments()
        super().write(event, **values)
        self._moments()

    def confirm(self, event: str, **values: Any) -> None:
        self._moments()
        super().confirm(event, **values)
        self._moments()

    def finish(self) -> None:
        self._moments()
        super().finish()


class Disk(ModuleType):
    """The module `os`, but the disk is full from some write on.

    Args:
        at: The number of that write.
        fits: How many of its bytes there is room for.
        lasts: How many writes fail.
    """

    def __init__(self, at: int = 0, fits: int = 0, lasts: int = 0) -> None:
        super().__init__("os")
        self._at, self._fits, self._lasts, self.writes = at, fits, lasts, 0

    def __getattr__(self, name: str) -> Any:
        return getattr(os, name)

    def write(self, descriptor: int, data: bytes) -> int:
        self.writes += 1
        if self.writes == self._at and self._fits:
            return os.write(descriptor, data[: self._fits])
        if 0 <= self.writes - self._at - bool(self._fits) < self._lasts:
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
        """List, bytes, default program and password are those of the user."""
        store = self.robot._store
        assert {name: store.read(name) for name in store.names()} == self.files
        assert store.settings.default_program == self.default
        assert store.settings.password == PASSWORD

    def run(
        self,
        folder: str,
        only: Only,
        moments: Moments | None = None,
        token: str = "aaaa",
    ) -> Results | None:
        """Run these cases; without results if the process was killed."""
        moments, path = moments or Moments(), Path(folder) / "journal"
        journal = WatchedJournal(path, moments)
        tokens = iter((token, *(f"aa{a}{b}" for a in "abc" for b in "abcdefgh")))
        setting = ControllerAdapter(
            WatchedAccess(self.robot.network, moments=moments, journal=path),
            Ics(hooks={"restart": hooks_of(self.robot)["restart"]}),
            PASSWORD,
            Options(only=frozenset(r.id for r in select(",".join(only))), allowed=ALL, examples=2),
            journal=journal,
            draw_token=tokens.__next__,
        )
        run = Run(setting)
        if moments.act is end_in_order:
            moments.act = run.interruption.ask
        try:
            with ThreadPoolExecutor(1) as thread:  # in which hypothesis can draw for the run, too
                return thread.submit(run.results).result()
        except BaseException:
            if not moments.dead:
                raise
            for connection in [*self.robot.network._links]:
                self.robot.network.hang_up(connection)
            return None
        finally:
            journal.close()


def end_in_order() -> None:
    """Stands for Ctrl-C."""


class Size(NamedTuple):
    """How long a run is that nothing interrupts: points, and writes of its journal."""

    points: int
    writes: int


@cache
def size(only: Only) -> Size:
    """The size of a run of these cases."""
    moments, disk = Moments(), Disk()
    with pytest.MonkeyPatch.context() as patch, TemporaryDirectory() as folder:
        patch.setattr(journal_module, "os", disk)
        Device({b"mine.rob": b"!"}, b"").run(folder, only, moments)
    return Size(moments.passed, disk.writes)


CONTENTS = {path.read_bytes(): path.stem for path in sorted(PROGRAMS.rglob("*.rob"))}
"""Program files by their content."""


@st.composite
def devices(draw: st.DrawFn, fault: str = "") -> Device:
    """Controllers with some files, of which one may be the default program."""
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
"""Where in a run something happens, in thousandths of it."""
tokens = st.sampled_from(("aaaa", "zzzz"))
"""What is in the names of the next run's files; the first run has the former."""


def few(examples: int) -> Callable[[Any], Any]:
    """So many examples: each is one run or several, so that shrinking would take minutes."""
    return settings(
        max_examples=examples,
        phases=(Phase.explicit, Phase.generate),
        suppress_health_check=[HealthCheck.too_slow],
    )


@few(3)
@given(devices(), selections)
def test_normal_end(device: Device, only: Only) -> None:
    """A run that ends in order leaves the user's files as they were, and no journal."""
    with TemporaryDirectory() as folder:
        results = device.run(folder, only)
        assert results
        device.assert_unchanged()
        assert not any(Path(folder).iterdir())


@few(5)
@given(devices(), selections, parts)
def test_interruption(device: Device, only: Only, part: int) -> None:
    """A run that is ended by Ctrl-C leaves the user's files as they were, and no journal."""
    with TemporaryDirectory() as folder:
        device.run(folder, only, Moments(1 + size(only).points * part // 1000, end_in_order))
        device.assert_unchanged()
        assert not any(Path(folder).iterdir())


@few(5)
@given(st.sampled_from(MUTANTS).flatmap(devices), selections)
def test_failure(device: Device, only: Only) -> None:
    """A run against a faulty controller leaves the user's files as they were."""
    with TemporaryDirectory() as folder:
        device.run(folder, only)
        device.assert_unchanged()


@few(5)
@given(devices(), selections, parts, st.integers(0, 60), st.sampled_from((1, 3, 10_000)))
def test_full_disk(device: Device, only: Only, part: int, fits: int, lasts: int) -> None:
    """A run whose journal cannot be written is inconclusive and puts everything back."""
    disk = Disk(1 + size(only).writes * part // 1000, fits, lasts)
    with TemporaryDirectory() as folder:
        with pytest.MonkeyPatch.context() as patch, suppress(JournalError):  # it cannot begin
            patch.setattr(journal_module, "os", disk)
            results = device.run(folder, only)
            assert results
            assert results.verdict is Conclusion.INCONCLUSIVE
        device.assert_unchanged()
        if any(Path(folder).iterdir()):
            device.run(folder, ("4.8/2",))
            device.assert_unchanged()
        assert not any(Path(folder).iterdir())


@few(5)
@given(
    devices(), st.tuples(selections, selections), st.lists(parts, min_size=1, max_size=2), tokens
)
def test_kill(device: Device, only: tuple[Only, Only], parts: list[int], token: str) -> None:
    """The run after a killed run puts back what that has left, wherever it was killed."""
    killed, then = only
    with TemporaryDirectory() as folder:
        for part in parts:
            moments = Moments(1 + size(killed).points * part // 1000)
            moments.act = moments.kill
            device.run(folder, killed, moments)
        results = device.run(folder, then, token=token)
        assert results
        device.assert_unchanged()
        assert not any(Path(folder).iterdir())
