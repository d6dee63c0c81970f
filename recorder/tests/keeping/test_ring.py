"""The last seconds before a trigger, and those after it, are in a file of their own."""

import json
import logging
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap.reader import make_reader

from scaraspec.judgement.happenings import Transfer
from scaraspec.judgement.judge import Judge
from scaraspec.judgement.wire import Kind, WireEvent
from scaraspec.protocol.direction import A2C, C2A
from scaraspec.protocol.payloads import Acceptance, Outcome
from scaraspec_recorder.deriving.deriver import Deriver, Item
from scaraspec_recorder.deriving.sinks import Folder
from scaraspec_recorder.deriving.wording import Line
from scaraspec_recorder.keeping.contents import Contents
from scaraspec_recorder.keeping.file_sets import Shelf
from scaraspec_recorder.keeping.ring import MOST_A_MINUTE, MOST_AT_ONCE, Incidents, Ring
from scaraspec_recorder.keeping.seams import Links
from scaraspec_recorder.keeping.triggers import Pressed, parse_trigger
from scaraspec_recorder.mcap import schemas
from scaraspec_recorder.mcap.mcap_reading import read_mcap
from scaraspec_recorder.quantities import SECOND_NS

PLENTY = 1 << 30
REFUSED = Acceptance(accepted=False, code="01")


class Tape:
    """An output that keeps what it is given."""

    def __init__(self) -> None:
        self.events: list[WireEvent] = []
        self.items: list[Item] = []

    def write(self, event: WireEvent) -> None:
        self.events.append(event)

    def take(self, item: Item, number: int, line: Line | None) -> None:  # noqa: ARG002 - an `Output`
        self.items.append(item)

    def tick(self, now_ns: int) -> None:
        pass

    def close(self, summary: Any) -> None:
        pass


class Watch:
    """Incidents on a folder, fed by a conversation."""

    def __init__(self, folder: Path, *triggers: str, before_s: int = 10, after_s: int = 5) -> None:
        self.folder = folder
        contents = Contents(folder)
        contents.save()
        shelf = Shelf(Folder(folder, []), contents, "line 3", draw=False)
        self.watchers = {text: parse_trigger(text) for text in triggers}
        ring = Ring(before_s * SECOND_NS, PLENTY)
        incidents = Incidents(shelf, ring, self.watchers, after_s * SECOND_NS)
        self.sink = Deriver([incidents], Judge())

    def feed(self, events: Iterable[WireEvent]) -> None:
        for event in events:
            self.sink.write(event)

    @property
    def files(self) -> list[Path]:
        """Those that are complete, in the order in which they were."""
        lines = (self.folder / "contents.jsonl").read_text().splitlines()
        return [self.folder / json.loads(line)["name"] for line in lines]


def poll(talk: Any, seconds: int, status: str = "00") -> None:
    """Ask for the status once a second."""
    for _ in range(seconds):
        talk.time_ns += SECOND_NS - 3_000_000
        talk.ask("get_status", None, status)


def metadata(path: Path, name: str) -> dict[str, str]:
    with path.open("rb") as file:
        return next(m.metadata for m in make_reader(file).iter_metadata() if m.name == name)


def messages(path: Path, topic: str, kind: type[Any]) -> list[Any]:
    with path.open("rb") as file:
        found = make_reader(file).iter_messages(topics=[topic])
        return [schemas.decode(kind, message.data) for _, _, message in found]


def findings(path: Path) -> list[str]:
    return [found.requirement for found in messages(path, "/findings", schemas.Finding)]


@pytest.fixture
def session(talk: Any) -> Any:
    """A conversation after its login, with half a minute of polling."""
    talk.mark(A2C, Kind.OPENED, "10.0.0.1:5 to 10.0.0.2:8877")
    talk.ask("login", b"password", reply=True)
    poll(talk, 30)
    return talk


def test_an_incident_has_the_seconds_before_and_after(tmp_path: Path, session: Any) -> None:
    """And says what fired, when and why; nothing else is written."""
    session.ask("reset", None, REFUSED)
    fired_ns = session.time_ns
    poll(session, 30)
    watch = Watch(tmp_path, "refusal")
    watch.feed(session.events)
    watch.sink.close()
    (path,) = watch.files
    assert path.name == "2026-11-20T22-59-07Z_line-3_refusal.mcap"
    raw = [event for event in read_mcap(path) if event.data]
    assert raw == [
        event
        for event in session.events
        if event.data and -10 <= (event.time_ns - fired_ns) / SECOND_NS <= 5
    ]
    told = metadata(path, "session")
    assert told["trigger"] == "refusal"
    assert told["triggered by"] == "reset: refused 01 running a program"
    assert told["triggered at time_ns"] == str(fired_ns)
    assert told["triggered at"] == "2026-11-20 22:59:07 UTC"
    assert [p.name for p in tmp_path.glob("*.mcap")] == [path.name]


def test_an_incident_begins_with_its_connections(tmp_path: Path, session: Any) -> None:
    """Opened again at its begin, so that a reader takes the middle for no beginning."""
    session.ask("reset", None, REFUSED)
    watch = Watch(tmp_path, "refusal")
    watch.feed(session.events)
    watch.sink.close()
    events = list(read_mcap(watch.files[0]))
    assert events[0].kind is Kind.OPENED
    assert events[0].note == "10.0.0.1:5 to 10.0.0.2:8877, since 2026-11-20 22:58:37 UTC"
    first = next(event for event in events if event.data)
    assert {event.time_ns for event in events[:5]} == {first.time_ns}


def test_an_incident_says_what_was_judged_with_all_in_mind(tmp_path: Path, session: Any) -> None:
    """What began before the ring comes whole into the file, and nobody is blamed for the cut."""
    session.ask("run_program", b"a.rob", Acceptance(accepted=True))
    poll(session, 60, "01")
    session.send(C2A, b"\x00noise")
    session.result("run_program", Outcome(done=False, code="12"))
    watch = Watch(tmp_path, "code:12", before_s=3)
    watch.feed(session.events)
    watch.sink.close()
    (path,) = watch.files
    assert findings(path) == ["3/32"]
    run = next(x for x in messages(path, "/exchanges", schemas.Exchange) if x.result)
    assert (run.command, run.code, round(run.duration_s)) == ("run_program", "12", 60)
    (entry,) = Contents(tmp_path).entries.values()
    assert (entry.trigger, entry.findings) == ("code:12", {"fail": 1})


def test_a_trigger_whose_file_is_being_written_is_in_it(tmp_path: Path, session: Any) -> None:
    """It is the same incident, and its end is not put off; after that it is another."""
    for _ in range(4):
        session.ask("reset", None, REFUSED)
        session.time_ns += 2 * SECOND_NS
    watch = Watch(tmp_path, "refusal", after_s=5)
    watch.feed(session.events)
    watch.sink.close()
    assert [metadata(path, "summary")["triggers"] for path in watch.files] == [
        "3 x refusal",
        "1 x refusal",
    ]


def test_two_triggers_have_two_files(tmp_path: Path, session: Any) -> None:
    """Each says what else fired meanwhile."""
    session.ask("reset", None, REFUSED)
    session.mark(A2C, Kind.CLOSED)
    watch = Watch(tmp_path, "refusal", "disconnect", "malformed")
    watch.feed(session.events)
    watch.sink.close()
    triggers = {metadata(p, "session")["trigger"]: metadata(p, "summary") for p in watch.files}
    assert triggers["refusal"]["triggers"] == "1 x refusal, 1 x disconnect"
    assert triggers["disconnect"]["triggers"] == "1 x disconnect"
    assert len(triggers) == 2


def test_incidents_are_bounded_and_the_rest_is_counted(
    tmp_path: Path, session: Any, caplog: pytest.LogCaptureFixture
) -> None:
    """So many a minute; the next file says how often none was written."""
    caplog.set_level(logging.ERROR)
    for _ in range(40):
        session.ask("reset", None, REFUSED)
        session.time_ns += 2 * SECOND_NS
    watch = Watch(tmp_path, "refusal", after_s=1)
    watch.feed(session.events)
    watch.sink.close()
    assert len(watch.files) == MOST_A_MINUTE + 6
    told = [
        metadata(path, "session").get("earlier triggers without a file") for path in watch.files
    ]
    assert [text for text in told if text] == ["24 x refusal"]


def test_only_so_many_files_are_written_at_once(tmp_path: Path, session: Any) -> None:
    """However many conditions come true in one moment."""
    session.ask("reset", None, REFUSED)
    session.send(C2A, b"\x00noise")
    session.mark(A2C, Kind.RESET)
    conditions = ("refusal", "code:01", "disconnect", "finding:fail", "finding:3/32", "malformed")
    watch = Watch(tmp_path, *conditions)
    watch.feed(session.events)
    watch.sink.close()
    assert len(watch.files) == MOST_AT_ONCE


def test_time_alone_fires_and_ends(tmp_path: Path, session: Any) -> None:
    """Ticks are all there is: silence is noticed, its file comes to its end, and fires once."""
    watch = Watch(tmp_path, "silence:4s", before_s=10, after_s=5)
    watch.feed(session.events)
    quiet_ns = session.time_ns
    for quarter in range(4 * 20):
        watch.sink.tick(quiet_ns + quarter * SECOND_NS // 4)
        assert len(watch.files) == (quarter > 4 * 9)
    watch.sink.close()
    (path,) = watch.files
    times = [event.time_ns for event in read_mcap(path) if event.data]
    assert quiet_ns - 6 * SECOND_NS <= min(times) < quiet_ns - 5 * SECOND_NS


def test_a_writer_that_lags_takes_nothing_for_silence(tmp_path: Path, session: Any) -> None:
    """Its clock is that of what it gets: late is not silent."""
    watch = Watch(tmp_path, "silence:4s", "late:1s")
    for event in session.events:
        watch.sink.write(event)
        watch.sink.tick(event.time_ns + 3600 * SECOND_NS)
    watch.sink.close()
    assert watch.files == []


def test_a_clock_that_is_set_back_ends_an_incident(tmp_path: Path, session: Any) -> None:
    """Else it would last until that clock has come so far again."""
    session.ask("reset", None, REFUSED)
    session.time_ns -= 3600 * SECOND_NS
    session.ask("get_status", None, "00")
    watch = Watch(tmp_path, "refusal")
    watch.feed(session.events)
    assert len(watch.files) == 1
    watch.sink.close()


def test_who_asks_gets_what_just_happened(tmp_path: Path, session: Any) -> None:
    """At the next tick, also while nothing happens at all."""
    watch = Watch(tmp_path, "signal")
    pressed = watch.watchers["signal"]
    assert isinstance(pressed, Pressed)
    pressed.press()
    watch.sink.tick(1)
    watch.feed(session.events)
    pressed.press()
    watch.sink.tick(session.time_ns)
    watch.sink.close()
    nothing, something = (list(read_mcap(path)) for path in watch.files)
    assert nothing == []
    assert something[-1] == session.events[-1]


@given(st.lists(st.tuples(st.integers(0, 3 * SECOND_NS), st.integers(0, 400)), max_size=40))
def test_a_ring_is_bounded_and_has_no_hole(
    new_talk: Callable[[], Any], pieces: list[tuple[int, int]]
) -> None:
    """It holds the last events without exception, no more bytes and no older ones than it may."""
    talk, ring, links = new_talk(), Ring(10 * SECOND_NS, 20_000), Links()
    talk.mark(A2C, Kind.OPENED)
    for wait_ns, size in pieces:
        talk.time_ns += wait_ns
        talk.send(A2C, bytes(size), after_s=0)
    for event in talk.events:
        ring.write(event)
    tape = Tape()
    ring.replay(tape, talk.time_ns)
    kept = talk.events[len(talk.events) - ring.count :]
    for event in talk.events[: len(talk.events) - ring.count]:
        links.follow(event)
    assert tape.events == [*links.reopened(kept[0].time_ns), *kept]
    assert all(talk.time_ns - event.time_ns <= 10 * SECOND_NS for event in kept)
    assert sum(len(event.data) for event in kept) <= 20_000
    assert ring.size_bytes <= 20_000 or ring.count == 1


def test_what_was_transferred_counts_too() -> None:
    """The content of a file is in memory as long as the moment in which it was complete."""
    ring = Ring(10 * SECOND_NS, 20_000)
    for number in range(3):
        ring.write(WireEvent(number, "1", A2C, Kind.BYTES, b"x", number))
        transfer = Transfer(upload=True, name=b"a.rob", begun_ns=0, content=bytearray(15_000))
        ring.take(transfer, 0, None)
    ring.forget(3)
    assert ring.count == 1


def test_old_moments_are_forgotten_while_nothing_comes() -> None:
    """A ring of ten seconds holds ten seconds."""
    ring = Ring(10 * SECOND_NS, PLENTY)
    ring.write(WireEvent(0, "1", A2C, Kind.BYTES, b"x"))
    ring.forget(10 * SECOND_NS)
    assert ring.count == 1
    ring.forget(10 * SECOND_NS + 1)
    assert ring.count == ring.size_bytes == 0
