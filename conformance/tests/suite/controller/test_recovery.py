"""A run restores what an interrupted run left, as far as it is allowed, and reports it."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace
from io import StringIO
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

from scaraspec.judge.requirements import select
from scaraspec.judge.verdicts import Conclusion
from scaraspec.mutants.controller_run import Robot
from scaraspec.protocol.commands import BY_NAME, BY_OPCODE, PasswordChange
from scaraspec.protocol.direction import A2C
from scaraspec.protocol.fields import show
from scaraspec.protocol.frames import Frame, Framer
from scaraspec.protocol.hazard import Hazard
from scaraspec.protocol.readings import DEFAULT
from scaraspec.report import html, terminal
from scaraspec.report.model import Results
from scaraspec.suite.controller.harness.access import MemoryAccess
from scaraspec.suite.controller.harness.adapter import ControllerAdapter
from scaraspec.suite.controller.harness.own_files import OwnFiles
from scaraspec.suite.controller.harness.state.recovery import RecoveryError
from scaraspec.suite.controller.harness.suite_passwords import PLAIN_PASSWORD
from scaraspec.suite.engine.ics import Ics
from scaraspec.suite.engine.journal import Journal, JournalError
from scaraspec.suite.engine.plan import ALL, Options
from scaraspec.suite.engine.run import Run
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Action, Request

PROGRAM = (Path(__file__).parents[4] / "fixtures/programs/pick-and-place.rob").read_bytes()
PASSWORD = b"the user's own"
STATE = (Hazard.STATE,)
BEFORE = {
    "programs": ["mine.rob"],
    "default program": "mine.rob",
    "gripper centre": [1.0, 2.0, 3.0],
}
"""The settings before the interrupted run, as far as the tests need them."""


@dataclass
class InterruptedRun:
    """A controller with a program of its user, and the journal of an interrupted run.

    Attributes:
        path: The journal.
        core: The class of the controller.
        robot: The controller.
        requests: The requests that were sent, in order: the command and its data.
    """

    path: Path
    core: type[ControllerCore] = ControllerCore
    robot: Robot = field(init=False)
    requests: list[tuple[str, bytes]] = field(default_factory=list)

    def __post_init__(self) -> None:
        watched, framer = self.requests, Framer(A2C)

        class Watched(self.core):  # type: ignore[misc, name-defined]  # a class is given
            def receive(self, connection: int, data: bytes, now_s: float) -> Sequence[Action]:
                for item in framer.feed(data):
                    assert isinstance(item, Frame)
                    watched.append((BY_OPCODE[item.opcode].name, item.data))
                return super().receive(connection, data, now_s)

        self.robot = Robot(Watched, DEFAULT)
        self.robot._store.write(b"mine.rob", PROGRAM)
        self.set(default_program=b"mine.rob", password=PASSWORD, gripper_center=(1.0, 2.0, 3.0))

    def set(self, **settings: Any) -> None:
        """Change settings of the controller."""
        store = self.robot._store
        store.save(replace(store.settings, **settings))

    def interrupted(self, *records: tuple[str, dict[str, Any]]) -> None:
        """Write the journal of a run that was killed after these records."""
        journal = Journal(self.path)
        journal.begin("2026-01-01T00:00:00+00:00", BEFORE)
        for event, values in records:
            journal.write(event, **values)
        journal.close()

    def run(
        self,
        allowed: Collection[Hazard] = ALL,
        only: str = "4.8/2",
        journal: Journal | None = None,
    ) -> Results:
        """Start the next run."""
        journal = journal or Journal(self.path)
        options = Options(
            frozenset(r.id for r in select(only)),
            frozenset({Hazard.READ_ONLY, *allowed}),
            examples=3,
        )
        access = MemoryAccess(self.robot.network)
        adapter = ControllerAdapter(access, Ics(), PASSWORD, options, journal=journal)
        try:
            return Run(adapter).results()
        finally:
            journal.close()

    @property
    def passwords(self) -> list[bytes]:
        """The passwords of all logins."""
        return [data for name, data in self.requests if name == "login"]

    @property
    def names(self) -> list[bytes]:
        """The names of all files on the controller."""
        return self.robot._store.names()


@pytest.fixture
def bench(tmp_path: Path) -> InterruptedRun:
    """A conforming controller."""
    return InterruptedRun(tmp_path / "journal")


def change(setting: str) -> tuple[str, dict[str, Any]]:
    return "changing", {"setting": setting}


def password(value: str | None) -> tuple[str, dict[str, Any]]:
    return "password", {"value": value}


def stored(name: str) -> tuple[str, dict[str, Any]]:
    return "accepted", {"name": name}


def test_stop_comes_first(bench: InterruptedRun) -> None:
    """If the robot may be moving, the first request after the login is the emergency stop."""
    bench.interrupted(("motion", {}), password("zs"))
    bench.set(password=b"zs")
    results = bench.run()
    names = [name for name, _ in bench.requests]
    # The first login finds the current password.
    assert names[:3] == ["login", "login", "emergency_stop"]
    assert results.verdict.good
    assert "nothing was executing, or the stop failed" in results.notices[0]


def test_running_program_is_stopped(bench: InterruptedRun) -> None:
    """A program that an interrupted run started is stopped."""
    bench.robot._store.write(b"zsaaaa1.rob", (PROGRAM))
    bench.interrupted(("motion", {}), stored("zsaaaa1.rob"))
    line = bench.robot.network.connect()
    for name, data in (("login", PASSWORD), ("run_program", b"zsaaaa1.rob")):
        line.send(Frame(A2C, BY_NAME[name].opcode, data).encode())
    assert bench.robot._core.robot.task
    results = bench.run()
    assert "the robot was stopped" in results.notices[0]
    assert bench.names == [b"mine.rob"]


@pytest.mark.parametrize(
    ("record", "settings", "allowed", "error"),
    [
        (
            change("gripper centre"),
            {"gripper_center": (9.0, 9.5, 9.0)},
            (),
            r"the gripper centre was 9\.0\|9\.5\|9\.0 instead of 1\.0\|2\.0\|3\.0: .* state$",
        ),
        (("motion", {}), {}, STATE, r"may still be moving: .* --allow motion,state$"),
        (password("zs"), {"password": b"zs"}, STATE, r"password was zs: .* destructive,state$"),
        (stored("zs1.rob"), {}, (), r"zs1.rob was still stored: .* --allow state$"),
        (
            change("default program"),
            {"default_program": b"other.rob"},
            (),
            r"the default program was other.rob instead of mine.rob: .* --allow state$",
        ),
    ],
)
def test_recovery_not_allowed(
    bench: InterruptedRun,
    record: tuple[str, dict[str, Any]],
    settings: dict[str, Any],
    allowed: Collection[Hazard],
    error: str,
) -> None:
    """A recovery that is not allowed changes nothing, and the error names the missing option."""
    bench.robot._store.write(b"other.rob", PROGRAM)
    bench.interrupted(record)
    bench.set(**settings)
    before, journal = bench.robot._store.settings, bench.path.read_bytes()
    with pytest.raises(RecoveryError, match=error):
        bench.run(allowed)
    assert bench.robot._store.settings == before
    assert bench.path.read_bytes() == journal
    sent = {name for name, _ in bench.requests}
    assert all(BY_NAME[name].hazard is Hazard.READ_ONLY for name in sent - {"login"})


def test_five_passwords(bench: InterruptedRun) -> None:
    """Without --allow destructive, five passwords are tried, the last one that was set first."""
    bench.interrupted(*(password(f"zs{number}") for number in range(8)))
    bench.set(password=b"lost")
    with pytest.raises(RecoveryError, match=r"the suite has set is zs7\. Restore"):
        bench.run(STATE)
    assert bench.passwords == [b"zs7", PASSWORD, b"zs6", b"zs5", b"zs4"]


def test_more_passwords(bench: InterruptedRun) -> None:
    """With --allow destructive, more passwords are tried, and their number is reported."""
    bench.interrupted(*(password(f"zs{number}") for number in range(8)))
    bench.set(password=b"zs1")
    results = bench.run()
    assert results.verdict.good
    assert bench.robot._store.settings.password == PASSWORD
    more = int(results.notices[0].partition(": ")[2].partition(" more are tried")[0])
    tried = list(dict.fromkeys(bench.passwords))
    assert 5 < len(tried) <= 5 + more
    assert bench.passwords.count(b"zs7") == 1
    assert "the password was zs1" in results.notices[1]


class KeepsDefaultProgram(ControllerCore):
    """The default program cannot be deleted (A-4.11-1)."""

    def delete_program(self, request: Request) -> bool:
        return request.value != self.store.settings.default_program and super().delete_program(
            request
        )


@pytest.mark.parametrize("core", [ControllerCore, KeepsDefaultProgram])
def test_default_program(tmp_path: Path, core: type[ControllerCore]) -> None:
    """The default program of the user is restored, and the suite's file is deleted."""
    bench = InterruptedRun(tmp_path / "journal", core)
    bench.robot._store.write(b"zsaaaa1.rob", PROGRAM)
    bench.interrupted(stored("zsaaaa1.rob"), change("default program"))
    bench.set(default_program=b"zsaaaa1.rob")
    results = bench.run()
    assert results.verdict.good
    assert bench.robot._store.settings.default_program == b"mine.rob"
    assert bench.names == [b"mine.rob"]
    assert not bench.path.exists()


def test_changes_of_the_user(bench: InterruptedRun) -> None:
    """Later changes by the user are reported and kept, and do not stop the run."""
    bench.robot._store.write(b"zsaaaa1.rob", PROGRAM)
    bench.interrupted(stored("zsaaaa1.rob"), change("clock"))
    bench.robot._store.write(b"newer.rob", PROGRAM)
    bench.set(default_program=b"newer.rob")
    results = bench.run()
    assert results.verdict.good
    assert bench.names == [b"mine.rob", b"newer.rob"]
    assert bench.robot._store.settings.default_program == b"newer.rob"
    assert "newer.rob (the default program) was not listed at the start" in results.notices[0]
    assert "is newer.rob: the suite has not set it" in results.notices[0]


class ReversesPassword(ControllerCore):
    """A new password is stored in reverse order."""

    def set_password(self, request: Request) -> bool:
        old, new = request.value
        return super().set_password(replace(request, value=PasswordChange(old, new[::-1])))


def test_an_altered_password(tmp_path: Path) -> None:
    """If a controller alters a password, reports and journal contain the one that was set."""
    bench = InterruptedRun(tmp_path / "journal", ReversesPassword)
    results = bench.run(only="4.2/4")
    changes = Journal(bench.path).earlier
    assert changes
    last = changes.passwords[-1]
    assert last
    assert bench.robot._store.settings.password == last.encode()[::-1]
    assert results.verdict is Conclusion.NONCONFORMANT
    output = StringIO()
    terminal.show(results, Console(file=output, width=500))
    html.write(results, tmp_path / "report.html")
    results.write(tmp_path / "results.json")
    sentence = f"the last one that the suite has set is {show(last.encode())}"
    assert sentence in output.getvalue()
    for name in ("report.html", "results.json"):
        assert last in (tmp_path / name).read_text("utf-8"), name
    with pytest.raises(RecoveryError, match=last):
        bench.run()


class FullJournal(Journal):
    """A journal whose disk is full after a number of matching records.

    Args:
        path: The file.
        count: The number of records.
        event: The event of the records.
        values: Values that the records contain.
    """

    def __init__(self, path: Path, count: int = 0, event: str = "", **values: Any) -> None:
        super().__init__(path)
        self._remaining, self._event, self._values = count, event, values

    def write(self, event: str, **values: Any) -> None:
        super().write(event, **values)
        self._remaining -= event == self._event and self._values.items() <= values.items()

    def flush(self, *, wait: bool = True) -> None:
        if not self._remaining:
            self.failure = "the disk is full"
            raise JournalError(self.failure)
        super().flush(wait=wait)


def test_a_full_disk_after_a_password(bench: InterruptedRun) -> None:
    """The user's password is set again although this cannot be recorded."""
    journal = FullJournal(bench.path, 1, "password", value=PLAIN_PASSWORD.decode())
    results = bench.run(only="4.2", journal=journal)
    assert results.verdict is Conclusion.INCONCLUSIVE
    assert (PASSWORD + b"|" + PLAIN_PASSWORD) in [data for _, data in bench.requests]
    assert bench.robot._store.settings.password == PASSWORD


@pytest.mark.parametrize("count", range(1, 8))
def test_a_full_disk_after_an_upload(bench: InterruptedRun, count: int) -> None:
    """A file whose upload was accepted gets no content if this cannot be recorded."""
    results = bench.run(only="4.13/3", journal=FullJournal(bench.path, count, "offered"))
    assert results.verdict is Conclusion.INCONCLUSIVE
    uploads = [name for name, _ in bench.requests if name.startswith("upload")]
    assert uploads.count("upload_name") == count
    assert uploads[-1] == "upload_name"


def test_a_full_disk_in_a_recovery(bench: InterruptedRun) -> None:
    """The settings are restored although the next run cannot start."""
    bench.interrupted(change("*"))
    bench.set(default_program=b"")
    with pytest.raises(JournalError):
        bench.run(journal=FullJournal(bench.path))
    assert bench.robot._store.settings.default_program == b"mine.rob"


def test_a_token_in_use() -> None:
    """No file name of a run begins like the name of a stored file, in upper or lower case."""
    tokens = iter(("aaaa", "bbbb", "cccc"))
    files = OwnFiles(Journal(), tokens.__next__)
    files.begin([b"ZSAAAA7.ROB", b"zsbbbb", b"zscc1.rob"])
    assert files.new_name(".rob") == b"zscccc1.rob"
