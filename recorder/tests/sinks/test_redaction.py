"""Passwords are masked in raw bytes, however they are split, and nothing else is masked."""

from collections.abc import Iterable
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.direction import A2C, C2A, Direction
from scaraspec.protocol.fields import Diagnostics
from scaraspec.protocol.frames import Frame, Framer
from scaraspec.protocol.redaction import is_secret, mask
from scaraspec.protocol.transfer import Chunk, FileData
from scaraspec.traffic.wire import Kind, WireEvent
from scaraspec_recorder.sinks.redaction import MASKED_NOTE, Redactor

LOGIN = Frame(A2C, 0x01, b"open sesame").encode()
CHANGE = Frame(A2C, 0x03, b"open sesame|hocus pocus").encode()
# Data that looks like the start of a login, but is inside a frame and no password.
DECOY = Frame(A2C, 0x52, b"\xaa\x01\x05hello\xcc\x01\x03").encode()
STATUS = Frame(A2C, 0x09).encode()


def split(data: bytes, cuts: Iterable[int]) -> list[WireEvent]:
    """Return the bytes of a client as events, split at these positions, with replies in between."""
    events: list[WireEvent] = []
    for begin, end in pairwise(sorted({0, len(data), *(c % (len(data) + 1) for c in cuts)})):
        time_ns = len(events)
        events.append(WireEvent(time_ns, "1", A2C, Kind.BYTES, data[begin:end], begin))
        events.append(WireEvent(time_ns + 1, "1", C2A, Kind.BYTES, b"\xcc\x09\x0200\xaa"))
    return events


def redact(events: Iterable[WireEvent], *, flush_each: bool = False) -> list[WireEvent]:
    redactor = Redactor()
    given_out: list[WireEvent] = []
    for event in events:
        given_out += redactor.feed(event)
        if flush_each:
            given_out += redactor.flush()
    return [*given_out, *redactor.flush()]


def sent(events: Iterable[WireEvent], direction: Direction = A2C) -> bytes:
    return b"".join(event.data for event in events if event.direction is direction)


def frames(data: bytes) -> list[Frame]:
    return [item for item in Framer(A2C).feed(data) if isinstance(item, Frame)]


@given(
    st.lists(st.sampled_from([LOGIN, CHANGE, DECOY, STATUS]), min_size=1, max_size=6),
    st.lists(st.integers(0, 200), max_size=8),
)
def test_any_split(pieces: list[bytes], cuts: list[int]) -> None:
    """Same frames, lengths and order; only the data of secret frames differs."""
    events = split(b"".join(pieces), cuts)
    redacted = redact(events)
    assert [(e.time_ns, e.direction, len(e.data)) for e in redacted] == [
        (e.time_ns, e.direction, len(e.data)) for e in events
    ]
    assert sent(redacted, C2A) == sent(events, C2A)
    for before, after in zip(frames(sent(events)), frames(sent(redacted)), strict=True):
        assert before[:2] == after[:2]
        if is_secret(before):
            assert after.data == mask(before.data)
        else:
            assert after.data == before.data


@given(
    st.lists(st.sampled_from([LOGIN, CHANGE, STATUS]), min_size=1, max_size=4),
    st.lists(st.integers(0, 200), max_size=8),
)
def test_a_flush_at_any_time(pieces: list[bytes], cuts: list[int]) -> None:
    """Bytes of a partial frame are masked, and so is the rest of the frame."""
    redacted = sent(redact(split(b"".join(pieces), cuts), flush_each=True))
    for word in (b"open", b"sesame", b"pocus"):
        assert word not in redacted


@given(st.lists(st.tuples(st.sampled_from(Direction), st.binary(max_size=40)), max_size=20))
def test_any_bytes_keep_their_order_and_length(pieces: list[tuple[Direction, bytes]]) -> None:
    """Every event is returned once, in order, with its length."""
    offsets = dict.fromkeys(Direction, 0)
    events: list[WireEvent] = []
    for time_ns, (direction, data) in enumerate(pieces):
        events.append(WireEvent(time_ns, "1", direction, Kind.BYTES, data, offsets[direction]))
        offsets[direction] += len(data)
    redacted = redact(events)
    assert [(e.time_ns, e.offset_bytes, len(e.data)) for e in redacted] == [
        (e.time_ns, e.offset_bytes, len(e.data)) for e in events
    ]


@pytest.mark.parametrize(
    "data",
    [
        pytest.param(b"\xaa\x01\x09open sesame\xcc", id="wrong length"),
        pytest.param(b"\xaa" + LOGIN, id="behind a stray start byte"),
        pytest.param(LOGIN[:-4], id="split off"),
        pytest.param(b"\xaa\x30\xff" + LOGIN, id="within a frame that never ends"),
        pytest.param(b"\xaa\xaa\x03\x20open sesame|hocus pocus\xcc", id="stray and wrong"),
    ],
)
def test_a_malformed_login(data: bytes) -> None:
    """In invalid bytes, everything after a possible login is masked."""
    closed = WireEvent(9, "1", A2C, Kind.CLOSED, offset_bytes=len(data))
    for events in ([*split(data, ()), closed], [*split(data, range(len(data))), closed]):
        redacted = sent(redact(events))
        assert b"sesa" not in redacted
        assert len(redacted) == len(data)


def test_bytes_after_a_gap_in_a_login() -> None:
    """They may be the rest of a password."""
    gap = WireEvent(1, "1", A2C, Kind.GAP, b"", 6, 3, "lost")
    rest = WireEvent(2, "1", A2C, Kind.BYTES, LOGIN[9:] + STATUS, 9)
    redacted = redact([*split(LOGIN[:6], ())[:1], gap, rest])
    assert b"same" not in redacted[-1].data
    assert redacted[-1].data.endswith(STATUS)
    assert redacted[1] == gap


def test_masked_events_have_a_note() -> None:
    """A reader can distinguish them from a password made of asterisks."""
    hidden, answer, plain = redact([*split(LOGIN, ()), *split(STATUS, ())])[:3]
    assert (hidden.note, answer.note, plain.note) == (MASKED_NOTE, "", "")


def test_events_wait_until_their_frame_is_complete() -> None:
    """The other direction waits, too, so that the order is kept."""
    redactor = Redactor()
    begin, answer = split(LOGIN[:5], ())
    rest = WireEvent(5, "1", A2C, Kind.BYTES, LOGIN[5:], 5)
    assert list(redactor.feed(begin)) == []
    assert list(redactor.feed(answer)) == []
    assert [e.time_ns for e in redactor.feed(rest)] == [0, 1, 5]


def test_connections_do_not_wait_for_each_other() -> None:
    """A partial login on one connection does not delay another one."""
    redactor = Redactor()
    assert list(redactor.feed(WireEvent(0, "1", A2C, Kind.BYTES, LOGIN[:5]))) == []
    other = WireEvent(1, "2", A2C, Kind.BYTES, STATUS)
    assert list(redactor.feed(other)) == [other]


def test_memory_is_released_when_a_connection_ends() -> None:
    """After ten thousand connections no state remains."""
    redactor = Redactor()
    for number in range(100):
        list(redactor.feed(WireEvent(0, str(number), A2C, Kind.BYTES, LOGIN)))
        list(redactor.feed(WireEvent(0, str(number), A2C, Kind.CLOSED)))
    assert redactor._links == {}


SECRET = b"open sesame"


@pytest.mark.parametrize(
    ("direction", "data"),
    [
        pytest.param(A2C, LOGIN[1:], id="no start byte"),
        pytest.param(A2C, LOGIN[:1] + LOGIN[2:], id="no opcode"),
        pytest.param(A2C, b"login " + SECRET, id="bare text"),
        pytest.param(A2C, b"\xaa\x90" + LOGIN[1:], id="tagged"),
        pytest.param(A2C, Frame(A2C, 0x77, SECRET).encode(), id="unknown opcode"),
        pytest.param(C2A, b"no " + SECRET, id="bare text of the controller"),
        pytest.param(C2A, Frame(C2A, 0x0A, SECRET, tagged=True).encode(), id="one-stage result"),
        pytest.param(C2A, Frame(C2A, 0x32, SECRET, tagged=True).encode(), id="wrong result"),
    ],
)
def test_outside_of_known_frames(direction: Direction, data: bytes) -> None:
    """All is masked, also before a login and in any division."""
    for cuts in ((0, len(data)), range(len(data) + 1)):
        events = [
            WireEvent(begin, "1", direction, Kind.BYTES, data[begin:end], begin)
            for begin, end in pairwise(cuts)
        ]
        closed = WireEvent(len(data), "1", direction, Kind.CLOSED, offset_bytes=len(data))
        redacted = sent(redact([*events, closed]), direction)
        assert b"sesame" not in redacted
        assert len(redacted) == len(data)


@given(st.lists(st.integers(0, 200), max_size=8), st.sampled_from(Direction))
def test_a_known_password_in_other_frames(cuts: list[int], direction: Direction) -> None:
    """It is masked in all later frames of both directions, also on another connection."""
    frame = Frame(direction, 0x52, b"\x00\x01" + LOGIN + b"rest" + SECRET)
    data = frame.encode()
    login = WireEvent(0, "1", A2C, Kind.BYTES, LOGIN)
    positions = sorted({0, len(data), *(cut % len(data) for cut in cuts)})
    events = [
        WireEvent(1, "2", direction, Kind.BYTES, data[begin:end], begin)
        for begin, end in pairwise(positions)
    ]
    redacted = sent(redact([login, *events])[1:], direction)
    assert redacted == data.replace(SECRET, b"*" * len(SECRET))


@settings(max_examples=20)
@given(st.integers(1, 60), st.integers(0, 250))
def test_a_known_password_between_chunks_of_a_file(size_bytes: int, before_bytes: int) -> None:
    """At most a single byte of it is left, at the end of a chunk."""
    content = bytes(before_bytes) + SECRET + bytes(99)
    chunks = [
        Chunk(len(content), at, len(data), data)
        for at, data in (
            (at, content[at : at + size_bytes]) for at in range(0, len(content), size_bytes)
        )
    ]
    request = BY_NAME["upload_chunk"].request
    upload = b"".join(Frame(A2C, 0x52, request.encode(chunk)).encode() for chunk in chunks)
    _, *redacted = frames(sent(redact([*split(LOGIN, ()), *split(upload, ())])))
    left = b"".join(FileData().read(frame.data, Diagnostics()).data for frame in redacted)
    assert len(left) == len(content)
    rest = left.replace(b"\0", b"").replace(b"*", b"")
    assert len(rest) <= 1 or size_bytes == 1


def test_a_frame_without_an_opcode_that_looks_unfinished() -> None:
    """The length is taken for the opcode, and the password for the length and the data."""
    redacted = redact(split(LOGIN[:1] + LOGIN[2:], ()), flush_each=True)
    assert sent(redacted) == LOGIN[:1] + LOGIN[2:3] + b"*" * 12


@pytest.mark.parametrize("data", [b"11", b"00|0C", b"00|00"])
def test_final_results_are_kept(data: bytes) -> None:
    """The code of a result is no password."""
    opcode = BY_NAME["emergency_stop"].opcode
    result = Frame(C2A, opcode, data, tagged=True).encode()
    assert sent(redact([WireEvent(0, "1", C2A, Kind.BYTES, result)]), C2A) == result
