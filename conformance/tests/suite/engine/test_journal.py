"""The journal keeps its records if the process is killed or the disk is full."""

import errno
import json
import os
import stat
from pathlib import Path
from typing import Any

import pytest

from scaraspec.judge.requirements import select
from scaraspec.mutants.controller_run import Robot
from scaraspec.protocol.readings import DEFAULT
from scaraspec.suite.controller.harness.access import MemoryAccess
from scaraspec.suite.controller.harness.adapter import ControllerAdapter
from scaraspec.suite.controller.harness.suite_passwords import PLAIN_PASSWORD
from scaraspec.suite.engine import journal as journal_module
from scaraspec.suite.engine.ics import Ics
from scaraspec.suite.engine.journal import (
    Changes,
    ControllerBusyError,
    Journal,
    JournalError,
)
from scaraspec.suite.engine.plan import ALL, Options
from scaraspec.suite.engine.run import Run
from scaraspec.virtual_controller.core import ControllerCore

URL = "tcp://127.0.0.1:8877"
BEGUN = "2026-01-01T00:00:00+00:00"
SETTINGS = {"clock": [0.0, 1.5], "default program": "焊接.rob", "programs": ["a.rob"]}


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """The file of a journal."""
    return tmp_path / "journal"


def begun(path: Path) -> Journal:
    """The journal of a run that has changed something of each kind."""
    journal = Journal(path)
    journal.begin(BEGUN, SETTINGS)
    journal.write("changing", setting="clock")
    journal.write("password", value="zs")
    journal.write("offered", name="zsaaaa1.rob")
    journal.confirm("accepted", name="zsaaaa1.rob")
    journal.write("motion")
    return journal


def earlier(path: Path) -> Changes:
    """The records that the next run finds."""
    found = Journal(path).earlier
    assert found
    return found


def test_only_what_is_announced_is_waited_for(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A confirmation is written at once, and is on disk after the next announcement or flush."""
    waits: list[bytes] = []
    journal = begun(path)
    monkeypatch.setattr(os, "fsync", lambda _: waits.append(path.read_bytes()))
    for event in ("accepted", "deleted"):
        journal.confirm(event, name="zsaaaa1.rob")
    assert not waits
    assert earlier(path).files == []
    journal.flush()
    journal.flush()
    assert [text.count(b"deleted") for text in waits] == [1]


def test_records_of_a_killed_run(path: Path) -> None:
    """The next run reads the records of a killed run, and none of a run that ended normally."""
    assert Journal(path).earlier is None
    journal = begun(path)
    assert earlier(path) == Changes(
        BEGUN, SETTINGS, ["clock"], ["zs"], ["zsaaaa1.rob"], [], motion=True
    )
    journal.finish()
    assert Journal(path).earlier is None
    assert not [*path.parent.iterdir()]


def test_restored_settings(path: Path) -> None:
    """Restored settings are not restored again."""
    journal = begun(path)
    for event in ("restored", "password-restored", "rest"):
        journal.confirm(event)
    journal.confirm("deleted", name="zsaaaa1.rob")
    assert not earlier(path).any
    assert not journal.changes.any


@pytest.mark.parametrize("event", ["password", "offered"])
def test_truncated_at_every_byte(path: Path, event: str) -> None:
    """An incomplete last record is ignored, and the next record is kept."""
    journal = begun(path)
    complete, before = path.read_bytes(), earlier(path)
    journal.write(event, value="007", name="zsaaaa2.rob")
    after = earlier(path)
    longer = path.read_bytes()
    journal.close()
    assert after != before
    for size in range(len(complete), len(longer)):
        path.write_bytes(longer[:size])
        found = Journal(path)
        assert found.earlier == (after if size == len(longer) - 1 else before), size
        found.resume()
        found.write("changing", setting="network")
        found.close()
        assert earlier(path).changed == ["clock", "network"], size
        assert earlier(path).passwords == found.changes.passwords, size


def test_unreadable(path: Path) -> None:
    """A journal that cannot be read is reported in one sentence that names it."""
    path.mkdir()
    with pytest.raises(JournalError, match=rf"^the journal {path} cannot be read: Is a directory$"):
        Journal(path)


@pytest.mark.parametrize(
    "line",
    [
        '{"event": "run", "format": 2, "started": "2027-01-01", "process": 1}',
        '{"event": "run", "started": "2027-01-01"}',
        '{"event": "torque", "value": 5}',
        '{"event": "password"}',
        "[]",
        "5",
    ],
)
def test_another_format(path: Path, line: str) -> None:
    """A journal of another version is not interpreted: one sentence names its line."""
    path.write_text(line + "\n", "utf-8")
    with pytest.raises(JournalError, match=rf"^line 1 of the journal {path} is of another version"):
        Journal(path)


def test_private(tmp_path: Path) -> None:
    """Only the user can read the journal, its lock and the folder that is made for them."""
    folder = tmp_path / "new" / "state"
    with Journal.of(URL, folder) as journal:
        journal.begin(BEGUN, SETTINGS)
        modes = {path.suffix: stat.S_IMODE(path.stat().st_mode) for path in folder.iterdir()}
    assert modes == {".journal": 0o600, ".lock": 0o600}
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700


def test_one_run_at_a_time(tmp_path: Path) -> None:
    """If another run uses the controller, one sentence reports it; other controllers can be
    used."""
    with Journal.of(URL, tmp_path):
        with (
            pytest.raises(ControllerBusyError, match=rf"^another scaraspec run is using {URL}: "),
            Journal.of(URL, tmp_path),
        ):
            pytest.fail("two runs have the journal")
        with Journal.of("tcp://127.0.0.1:8878", tmp_path):
            pass
    with Journal.of(URL, tmp_path):
        pass


def test_state_directory(tmp_path: Path) -> None:
    """A state directory that cannot be made is reported in one sentence with a remedy."""
    file = tmp_path / "file"
    file.touch()
    for folder in (file, file / "state", file / "new" / "state"):
        with (
            pytest.raises(JournalError, match=rf"^the state directory {folder} cannot be used: .*"),
            Journal.of(URL, folder),
        ):
            pytest.fail("the journal is in a file")


@pytest.fixture
def room_bytes(monkeypatch: pytest.MonkeyPatch) -> dict[str, int]:
    """The number of bytes that fit on the disk of the journal."""
    room = {"bytes": 1_000_000}

    def write(descriptor: int, data: bytes) -> int:
        if not room["bytes"]:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        size = os.write(descriptor, data[: room["bytes"]])
        room["bytes"] -= size
        return size

    class Disk:
        def __getattr__(self, name: str) -> Any:
            return write if name == "write" else getattr(os, name)

    monkeypatch.setattr(journal_module, "os", Disk())
    return room


@pytest.mark.parametrize("fits", [0, 1, 20, 30])
def test_full_disk(path: Path, room_bytes: dict[str, int], fits: int) -> None:
    """A change that cannot be written is refused; if there is space again, later records are
    kept."""
    journal = begun(path)
    room_bytes["bytes"] = fits
    with pytest.raises(JournalError, match=r"cannot be written: No space left on device$"):
        journal.write("changing", setting="network")
    assert journal.changes.changed == ["clock"]
    assert journal.failure
    journal.confirm("deleted", name="zsaaaa1.rob")
    assert journal.changes.files == []
    room_bytes["bytes"] = 1_000_000
    journal.write("password", value="007")
    assert earlier(path).passwords == ["zs", "007"]
    assert earlier(path).files == []


def test_full_disk_while_restoring(path: Path, room_bytes: dict[str, int]) -> None:
    """A restored setting may be missing in the journal."""
    journal = begun(path)
    room_bytes["bytes"] = 0
    with journal.restoring():
        journal.write("password", value=None)
    with pytest.raises(JournalError):
        journal.write("password", value="zs")
    assert journal.changes.passwords == ["zs", None]


def test_full_disk_at_the_start(path: Path, room_bytes: dict[str, int]) -> None:
    """A run that cannot start its journal does not change that of an interrupted run."""
    begun(path).close()
    before = path.read_bytes()
    room_bytes["bytes"] = 50
    journal = Journal(path)
    with pytest.raises(JournalError):
        journal.begin(BEGUN, {})
    journal.close()
    assert path.read_bytes() == before


class KeptJournal(Journal):
    """A journal whose file stays after the end."""

    text = ""

    def finish(self) -> None:
        assert self.path
        self.text = self.path.read_text("utf-8")
        super().finish()


def test_no_password_of_the_user(path: Path) -> None:
    """The journal contains each password that the suite has set, and never the user's own."""
    robot = Robot(ControllerCore, DEFAULT)
    robot.set_password(password := b"Geheim-42")
    journal = KeptJournal(path)
    only = frozenset(r.id for r in select("4.1,4.2"))
    options = Options(only=only, allowed=ALL, examples=30)
    access = MemoryAccess(robot.network)
    results = Run(ControllerAdapter(access, Ics(), password, options, journal=journal)).results()
    assert results.verdict.good
    written = [json.loads(line) for line in journal.text.splitlines()]
    named = {record.get("value") for record in written if record["event"] == "password"}
    assert {None, PLAIN_PASSWORD.decode()} < named
    for form in (password, password.hex().encode(), password[1:], password[:-1]):
        assert form.decode() not in journal.text
