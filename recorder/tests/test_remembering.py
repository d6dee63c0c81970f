"""A ring outlives the process that keeps it: the next one is told again what was in it."""

import gc
import warnings
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from scaraspec.judgement.wire import Kind, WireEvent
from scaraspec.protocol.direction import A2C, C2A
from scaraspec.protocol.payloads import Acceptance
from scaraspec_recorder import scribe as scribe_module
from scaraspec_recorder.deriving.sinks import TICK_NS
from scaraspec_recorder.keeping.archive import Archive, archive_sink
from scaraspec_recorder.mcap.mcap_reading import read_mcap
from scaraspec_recorder.quantities import SECOND_NS
from scaraspec_recorder.scribe import Scribe
from scaraspec_recorder.spooling.records import stream_number
from scaraspec_recorder.spooling.spool import SpoolReader, SpoolWriter, backlog_bytes, unread_bytes

BEFORE_S, AFTER_S = 10, 5
ARCHIVE = Archive(
    "x",
    draw=False,
    continuous=False,
    triggers=("refusal",),
    before_ns=BEFORE_S * SECOND_NS,
    after_ns=AFTER_S * SECOND_NS,
)


class Writing:
    """A spool, and one writing process after another."""

    def __init__(self, folder: Path, archive: Archive = ARCHIVE) -> None:
        self.spool = folder / "spool"
        self.out = folder / "out"
        self.out.mkdir()
        self._archive = archive
        self._now_ns = 1
        self._writer = SpoolWriter(
            self.spool, lambda _delay, _do: None, limit_bytes=1 << 20, now_ns=lambda: 1
        )
        self._reader = SpoolReader(self.spool)
        self._scribe = self._new_scribe()

    def pass_on(self, events: list[WireEvent]) -> None:
        """Let these pass, and be written."""
        for event in events:
            stream = stream_number(int(event.connection), event.direction)
            payload = event.data or event.note.encode()
            self._writer.append(event.kind, stream, event.time_ns, event.offset_bytes, payload)
        self._writer.flush()
        self._now_ns += TICK_NS
        self._step()

    def die(self) -> None:
        """Kill the writing process; another begins."""
        self._reader.close()
        del self._scribe
        with warnings.catch_warnings(action="ignore", category=ResourceWarning):
            gc.collect()  # with the files that it had open
        self._reader = SpoolReader(self.spool)
        self._scribe = self._new_scribe()

    def end(self) -> list[Path]:
        """End in order; return the files in the order of their making."""
        self._writer.close()
        self._step()
        self._scribe.finish()
        self._reader.close()
        assert not self._scribe.progress.problems
        return [self.out / name for name in self._scribe.progress.files]

    def _new_scribe(self) -> Scribe:
        sink = partial(archive_sink, archive=self._archive, now_ns=lambda: self._now_ns)
        return Scribe(self._reader, self.out, [sink], now_ns=lambda: self._now_ns)

    def _step(self) -> None:
        while self._scribe.step():
            pass


@pytest.fixture
def writing(tmp_path: Path) -> Writing:
    return Writing(tmp_path)


def poll(talk: Any, seconds: int) -> list[WireEvent]:
    """Ask for the status once a second."""
    before = len(talk.events)
    for _ in range(seconds):
        talk.time_ns += SECOND_NS - 3_000_000
        talk.ask("get_status", None, "00")
    return talk.events[before:]


def refuse(talk: Any) -> list[WireEvent]:
    """Have something refused."""
    before = len(talk.events)
    talk.ask("reset", None, Acceptance(accepted=False, code="01"))
    return talk.events[before:]


def login(talk: Any) -> list[WireEvent]:
    """Open a connection."""
    talk.mark(A2C, Kind.OPENED, "10.0.0.1:5 > 10.0.0.2:8877")
    talk.ask("login", b"password", reply=True)
    return list(talk.events)


def around(talk: Any, fired_ns: int) -> list[WireEvent]:
    """What belongs to an incident."""
    return [
        event
        for event in talk.events
        if event.data and -BEFORE_S <= (event.time_ns - fired_ns) / SECOND_NS <= AFTER_S
    ]


def held(path: Path) -> list[WireEvent]:
    return [event for event in read_mcap(path) if event.data]


@pytest.mark.parametrize("deaths", [1, 3])
def test_a_death_before_a_trigger(writing: Writing, talk: Any, deaths: int) -> None:
    """Costs nothing of the seconds before it."""
    writing.pass_on(login(talk) + poll(talk, 15))
    writing.pass_on(poll(talk, 15))
    for _ in range(deaths):
        writing.die()
        writing.pass_on(poll(talk, 2))
    writing.pass_on(refuse(talk))
    fired_ns = talk.time_ns
    writing.pass_on(poll(talk, 7))
    (path,) = writing.end()
    assert held(path) == around(talk, fired_ns)
    opened, *others = [event for event in read_mcap(path) if event.kind is Kind.OPENED]
    assert opened.note.startswith("10.0.0.1:5 > 10.0.0.2:8877, since ")
    assert not others


def test_a_death_within_an_incident(writing: Writing, talk: Any) -> None:
    """What was written is mended, and a second file has all of it."""
    writing.pass_on(login(talk) + poll(talk, 30) + refuse(talk))
    fired_ns = talk.time_ns
    writing.pass_on(poll(talk, 2))
    writing.die()
    writing.pass_on(poll(talk, 7))
    first, second = writing.end()
    assert second.name == f"{first.stem}-2.mcap"
    assert held(first) == [
        e for e in around(talk, fired_ns) if e.time_ns <= fired_ns + 2 * SECOND_NS
    ]
    assert held(second) == around(talk, fired_ns)


def test_a_death_after_an_incident(writing: Writing, talk: Any) -> None:
    """Does not write it again, though its trigger is still in the ring."""
    writing.pass_on(login(talk) + poll(talk, 30) + refuse(talk) + poll(talk, 8))
    writing.die()
    writing.pass_on(poll(talk, 7))
    assert len(writing.end()) == 1


def test_what_is_written_all_along_is_not_written_twice(tmp_path: Path, talk: Any) -> None:
    """Only the incident tells again what the files before it hold."""
    archive = Archive("x", draw=False, triggers=("refusal",))
    writing = Writing(tmp_path, archive)
    writing.pass_on(login(talk) + poll(talk, 30))
    writing.die()
    writing.pass_on(poll(talk, 5) + refuse(talk))
    paths = writing.end()
    all_along = [path for path in paths if "refusal" not in path.name]
    (incident,) = set(paths) - set(all_along)
    sent = [event for event in talk.events if event.data]
    assert len(all_along) == 2
    assert [event for path in all_along for event in held(path)] == sent
    assert held(incident) == sent


def test_the_spool_keeps_no_more_than_the_ring_needs(writing: Writing, talk: Any) -> None:
    """And nothing of it counts as waiting to be written."""
    writing.pass_on(login(talk))
    for _ in range(20):
        talk.send(A2C, bytes(30_000), after_s=2)
        talk.send(C2A, bytes(30_000), after_s=2)
        writing.pass_on(talk.events[-2:])
    assert BEFORE_S // 4 * 60_000 <= backlog_bytes(writing.spool) < 300_000
    assert unread_bytes(writing.spool) == 0
    writing.end()
    assert backlog_bytes(writing.spool) < 130_000


def test_the_spool_keeps_room_for_what_is_unwritten(
    writing: Writing, talk: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A ring that is larger than that begins later after a death."""
    monkeypatch.setattr(scribe_module, "KEPT_BYTES", 150_000)
    writing.pass_on(login(talk))
    for _ in range(8):
        talk.send(A2C, bytes(40_000), after_s=1)
        writing.pass_on(talk.events[-1:])
    assert backlog_bytes(writing.spool) < 200_000
    writing.die()
    writing.pass_on(refuse(talk))
    (path,) = writing.end()
    assert held(path) == [e for e in talk.events if e.data][-len(held(path)) :]
    assert len(held(path)) >= 3


def test_a_spool_that_lost_what_was_kept(writing: Writing, talk: Any) -> None:
    """The ring begins where it can; nothing that is new is missing."""
    writing.pass_on(login(talk))
    for _ in range(8):
        talk.send(A2C, bytes(40_000), after_s=1)
        writing.pass_on(talk.events[-1:])
    first, *_ = sorted(writing.spool.glob("*.spool"), key=lambda path: int(path.stem))
    first.unlink()
    writing.die()
    new = poll(talk, 1) + refuse(talk)
    writing.pass_on(new)
    (path,) = writing.end()
    assert [event for event in held(path) if event in new] == [e for e in new if e.data]
