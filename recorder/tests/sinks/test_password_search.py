"""A redacted recording does not contain a password in any form, however it passes over the link.

A few variants by default; 200 of them in `make test-runs`.
"""

import logging
from dataclasses import dataclass, field
from itertools import count, pairwise
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from passwords import contents, occurrences
from scaraspec.protocol.commands import BY_NAME, COMMANDS
from scaraspec.protocol.direction import A2C, C2A, Direction
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.transfer import Chunk
from scaraspec.traffic.wire import Kind, WireEvent
from scaraspec_recorder.recordings.capture import capture_sink
from scaraspec_recorder.sinks.sink import OutputFolder, SinkState

START_NS = 1_795_215_517_000_000_000
MAIN = "1"

Item = tuple[Direction, bytes]

passwords = st.one_of(
    st.text("abcdefghijkmnpqrstuvwxyzABCDEFGHJKLMNPQRSTUVWXYZ23456789-_.!$ ", min_size=6).map(
        str.encode
    ),
    st.binary(min_size=6).map(lambda data: data.replace(b"|", b"/")),
    st.text(min_size=6).map(lambda text: text.replace("|", "/").encode()),
).filter(lambda password: len(set(password)) > 4 and len(password) <= 20)


def login(password: bytes) -> bytes:
    return Frame(A2C, 0x01, password).encode()


def outside_of_frames(password: bytes, number: int) -> list[Item]:
    """Return bytes that are no frame, or one that is not known."""
    frame = login(password)
    longer = frame[:2] + bytes([(frame[2] + 1 + number) % 256]) + frame[3:]
    forms: tuple[Item, ...] = (
        (A2C, frame[1:]),
        (A2C, frame[:1] + frame[2:]),
        (A2C, frame[:2] + frame[3:]),
        (A2C, frame[:-1]),
        (A2C, longer),
        (A2C, b"\xaa" * (1 + number % 4) + frame),
        (A2C, b"\xaa\x90" + frame[1:]),
        (A2C, b"\xcc" + frame[1:-1] + b"\xaa"),
        (A2C, b"\xaa\x30\xff" + frame),
        (A2C, password),
        (A2C, b"login " + password + b"\r\n"),
        (A2C, Frame(A2C, 0xE0 + number % 16, password).encode()),
        (A2C, Frame(A2C, 0xE0 + number % 16, b"\x00" + frame).encode()),
        (C2A, b"no " + password),
        (C2A, frame),
        (C2A, Frame(C2A, 0x01, password).encode()),
        (C2A, Frame(C2A, 0xE0 + number % 16, password).encode()),
        (C2A, Frame(C2A, 0x0A, password, tagged=True).encode()),
        (C2A, Frame(C2A, 0x32, password, tagged=True).encode()),
    )
    return [forms[number % len(forms)]]


def in_a_frame(password: bytes, number: int) -> list[Item]:
    """Return a known frame with a password in its data."""
    command = COMMANDS[number % len(COMMANDS)]
    direction = tuple(Direction)[number % 2]
    around = (b"", b"|", b"x", b"x|y|", login(password))[number % 5]
    return [(direction, Frame(direction, command.opcode, around + password + around).encode())]


def in_a_file(password: bytes, number: int) -> list[Item]:
    """Return an upload of a file that contains a login, in one or two chunks."""
    content = bytes(number % 50) + b"let $p = " + login(password) + b"\r\n" * 20
    cut = number % (len(content) - 1) + 1
    request = BY_NAME["upload_chunk"].request
    pieces = [(at, content[at:end]) for at, end in pairwise((0, cut, len(content)))]
    frames = [BY_NAME["upload_name"].request.encode(b"secret.rob")]
    frames += [request.encode(Chunk(len(content), at, len(p), p)) for at, p in pieces]
    names = ("upload_name", "upload_chunk", "upload_chunk")
    items: list[Item] = []
    for name, data in zip(names, frames, strict=True):
        opcode = BY_NAME[name].opcode
        items += [
            (A2C, Frame(A2C, opcode, data).encode()),
            (C2A, Frame(C2A, opcode, b"1").encode()),
        ]
    return items


def change(password: bytes, number: int) -> list[Item]:
    """Return a login, or a change of the password."""
    other = b"former one"
    data = (password + b"|" + other, other + b"|" + password)[number % 2]
    return [(A2C, login(password) if number % 3 else Frame(A2C, 0x03, data).encode())]


@dataclass
class Variant:
    """How a password passes.

    Attributes:
        password: The password.
        events: The traffic.
        ticks: After which events everything is flushed.
        restart: After which event another writer process continues; None for none.
    """

    password: bytes
    events: list[WireEvent] = field(default_factory=list)
    ticks: frozenset[int] = frozenset()
    restart: int | None = None

    def record(self, folder: Path, *, redact: bool) -> None:
        """Record the traffic like the writer process."""
        sink = capture_sink(OutputFolder(folder, []), redact=redact, session={"robot": "line 3"})
        state = SinkState()
        offsets: dict[tuple[str, Direction], int] = {}
        for number, event in enumerate(self.events):
            sink.write(event)
            offsets[event.connection, event.direction] = event.offset_bytes + len(event.data)
            if number in self.ticks or number == self.restart:
                sink.tick(event.time_ns)
            if number == self.restart:
                sink.close()
                sink = capture_sink(OutputFolder(folder, [], state=state), redact=redact)
        sink.close()


@st.composite
def variants(draw: st.DrawFn) -> Variant:
    password = draw(passwords)
    parts = st.tuples(
        st.sampled_from((outside_of_frames, in_a_frame, in_a_file, change)), st.integers(0, 9999)
    )
    numbers = st.integers(0, 9999)
    items = [(outside_of_frames, number) for number in draw(st.lists(numbers, max_size=2))]
    items += [(change, draw(numbers)), *draw(st.lists(parts, min_size=1, max_size=4))]
    variant = Variant(password)
    names, now_ns = count(2), START_NS
    ends = {(MAIN, way): 0 for way in Direction}

    def add(connection: str, direction: Direction, kind: Kind, data: bytes = b"") -> None:
        nonlocal now_ns
        now_ns += 1_000_000
        at = ends.setdefault((connection, direction), 0)
        variant.events.append(WireEvent(now_ns, connection, direction, kind, data, at))
        ends[connection, direction] = at + len(data)

    add(MAIN, A2C, Kind.OPENED)
    for make, number in items:
        # What is no frame may hide the next frame, so it has a connection of its own.
        connection = str(next(names)) if make is outside_of_frames else MAIN
        if connection != MAIN:
            add(connection, A2C, Kind.OPENED)
        for direction, data in make(password, number):
            cuts = draw(st.sets(st.integers(1, max(len(data) - 1, 1)), max_size=4))
            for begin, end in pairwise(sorted({0, len(data), *cuts})):
                add(connection, direction, Kind.BYTES, data[begin:end])
        if connection != MAIN:
            add(connection, A2C, Kind.CLOSED)
    add(MAIN, A2C, Kind.CLOSED)
    variant.ticks = draw(st.frozensets(st.integers(0, len(variant.events)), max_size=6))
    return variant


def search(variant: Variant, folder: Path, *, redact: bool) -> list[str]:
    """Record a variant, and return the places of the password in files and log."""
    folder.mkdir()
    with (folder / "log").open("w") as log:
        handler = logging.StreamHandler(log)
        logging.getLogger().addHandler(handler)
        try:
            variant.record(folder, redact=redact)
        finally:
            logging.getLogger().removeHandler(handler)
    return occurrences(variant.password, contents(folder))


def check(variant: Variant, folder: Path) -> None:
    found = search(variant, folder / "redacted", redact=True)
    assert not found, (variant.password, found)
    control = search(variant, folder / "control", redact=False)
    assert any("of connection" in place for place in control)


@settings(max_examples=8)
@given(variants())
def test_a_few_variants(tmp_path_factory: pytest.TempPathFactory, variant: Variant) -> None:
    """A password is in the unredacted recording, and not in the redacted one."""
    check(variant, tmp_path_factory.mktemp("variant"))


@pytest.mark.runs
@settings(max_examples=200)
@given(variants())
def test_many_variants(tmp_path_factory: pytest.TempPathFactory, variant: Variant) -> None:
    """As above."""
    check(variant, tmp_path_factory.mktemp("variant"))
