"""The injector applies faults to the selected frames, records each fault and keeps the order."""

import math
import tomllib
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from scaraspec.protocol.direction import A2C, C2A, Direction
from scaraspec.protocol.frames import Frame
from scaraspec_recorder.fault_injection import injection_file
from scaraspec_recorder.fault_injection.injection_file import load_injection
from scaraspec_recorder.fault_injection.injector import (
    PARTIAL_FRAME_S,
    Action,
    Forward,
    HalfClose,
    InjectionNote,
    Injector,
    ResetBoth,
)
from scaraspec_recorder.fault_injection.rules import Injection

ASK = Frame(A2C, 0x09).encode()  # get_status
IDLE = Frame(C2A, 0x09, b"00").encode()
ASK_TIME = Frame(A2C, 0x07).encode()
STOP = Frame(A2C, 0x32).encode()
RESULT = Frame(C2A, 0x30, b"1", tagged=True).encode()
UNDEFINED = Frame(A2C, 0x70, b"x").encode()
SAMPLES = sorted((Path(__file__).parents[3] / "fixtures" / "injection").glob("*.toml"))

Load = Callable[[str], Injection]


@pytest.fixture
def injector(load: Load) -> Callable[..., Injector]:
    """Create an injector with rules from a text."""

    def make(text: str, connection: int = 1) -> Injector:
        return Injector(load(text), connection)

    return make


def rule(fault: str, *lines: str) -> str:
    return "\n".join((f'[[rule]]\nfault = "{fault}"', *lines, ""))


def sent(actions: Iterable[Action], direction: Direction) -> bytes:
    return b"".join(a.data for a in actions if isinstance(a, Forward) and a.direction is direction)


def notes(actions: Iterable[Action]) -> list[str]:
    return [action.note for action in actions if isinstance(action, InjectionNote)]


def run_out(injector: Injector) -> list[tuple[float, Action]]:
    """Advance the time until no frame waits."""
    done: list[tuple[float, Action]] = []
    for _ in range(100_000):
        if (now_s := injector.next_s) == math.inf:
            return done
        done += [(now_s, action) for action in injector.tick(now_s)]
    raise AssertionError("something waits for ever")


# Unchanged bytes

noise = st.binary(max_size=12)
frames = st.builds(
    lambda direction, opcode, data, tagged: Frame(
        direction, opcode, data, tagged and direction is C2A
    ).encode(),
    st.sampled_from(Direction),
    st.sampled_from([0x09, 0x30, 0x32, 0x52, 0x70]),
    st.binary(max_size=20),
    st.booleans(),
)
arrivals = st.lists(
    st.tuples(st.sampled_from(Direction), st.one_of(frames, noise), st.floats(0, 0.3)), max_size=40
)
ORDERLY = [
    rule("delay", "delay_ms = 30", "every = 3"),
    rule("jitter", "jitter_ms = 100", "probability = 0.4"),
    rule("fragment", "size_bytes = 2", "gap_ms = 1.5"),
    rule("coalesce", "frames = 3", "within_ms = 50", 'direction = "A2C"'),
    rule("hold-back", "at_most_ms = 400", 'until_command = "emergency_stop"', "command = 0x30"),
]


@given(arrivals)
def test_unselected_bytes_are_forwarded_in_order(
    stream: list[tuple[Direction, bytes, float]],
) -> None:
    """Frames, parts of frames and noise in any pieces: unchanged, without a note."""
    injector = Injector(Injection(()), 1)
    now_s, actions = 0.0, []
    for direction, data, after_s in stream:
        now_s += after_s
        if injector.next_s <= now_s:
            actions += injector.tick(now_s)
        actions += injector.receive(direction, data, now_s)
    for direction in Direction:
        actions += injector.finish(direction, now_s)
        complete = b"".join(data for way, data, _ in stream if way is direction)
        assert sent(actions, direction) == complete
    assert notes(actions) == []
    assert [a for a in actions if isinstance(a, HalfClose)] == [HalfClose(A2C), HalfClose(C2A)]


@given(arrivals, st.sets(st.sampled_from(ORDERLY)), st.integers(0, 5))
def test_timing_faults_keep_all_bytes_and_their_order(
    stream: list[tuple[Direction, bytes, float]], rules: set[str], seed: int
) -> None:
    """Delays, fragments and held frames do not change the stream; the end comes last."""
    table = tomllib.loads(f"seed = {seed}\n{''.join(sorted(rules))}")
    injector = Injector(injection_file._injection({"rule": [], **table}), 1)
    now_s, actions = 0.0, []
    for direction, data, after_s in stream:
        now_s += after_s
        while injector.next_s <= now_s:
            actions += injector.tick(injector.next_s)
        actions += injector.receive(direction, data, now_s)
    for direction in Direction:
        actions += injector.finish(direction, now_s)
    actions += [action for _, action in run_out(injector)]
    for direction in Direction:
        mine = [a for a in actions if a.direction is direction and not isinstance(a, InjectionNote)]
        assert sent(mine, direction) == b"".join(d for way, d, _ in stream if way is direction)
        assert mine[-1] == HalfClose(direction)
        assert injector.queued_bytes(direction) == 0


@given(arrivals, st.sampled_from(SAMPLES), st.integers(0, 30))
def test_a_flush_forwards_everything(
    stream: list[tuple[Direction, bytes, float]], sample: Path, count: int
) -> None:
    """After a flush no frame waits and no callback is needed."""
    injector = Injector(load_injection(sample), 1)
    for direction, data, _ in stream[:count]:
        injector.receive(direction, data, 0.0)
    injector.flush()
    assert injector.next_s == math.inf
    assert injector.flush() == []
    for direction, data, _ in stream[count:]:
        assert injector.receive(direction, data, 1.0) == []


# The effect of each fault


def test_a_delay_also_delays_later_frames(injector: Any) -> None:
    """The order is kept; both are noted with their position."""
    late = injector(rule("delay", "delay_ms = 250", 'command = "get_status"', 'part = "reply"'))
    assert late.receive(A2C, ASK, 1.0) == [Forward(A2C, ASK)]
    assert late.receive(C2A, IDLE, 1.0) == [
        InjectionNote(C2A, "get_status reply at bytes 0-5: rule 1: 250 ms late")
    ]
    assert late.receive(C2A, RESULT, 1.1) == [
        InjectionNote(C2A, "run_program result at bytes 6-11: waits for delayed frames")
    ]
    assert late.next_s == 1.25
    assert late.tick(1.249) == []
    assert late.tick(1.25) == [Forward(C2A, IDLE + RESULT)]


def test_jitter_is_reproducible_per_connection(injector: Any) -> None:
    """The jitter depends only on the seed and the connection."""
    text = "seed = 5\n" + rule("jitter", "jitter_ms = 100")

    def waits(connection: int) -> list[str]:
        follows = injector(text, connection)
        return notes(follows.receive(A2C, ASK * 5, 0.0))

    assert waits(1) == waits(1)
    assert waits(1) != waits(2)
    assert len(set(waits(1))) == 5


def test_the_delay_between_fragments(injector: Any) -> None:
    """It starts when the previous piece was actually forwarded."""
    truncated = injector(rule("fragment", "size_bytes = 3", "gap_ms = 10"))
    (printed, first) = truncated.receive(C2A, IDLE, 0.0)
    assert printed.note.endswith("rule 1: in pieces of 3 bytes, 10 ms apart")
    assert first == Forward(C2A, IDLE[:3])
    assert truncated.next_s == 0.01
    assert truncated.tick(5.0) == [Forward(C2A, IDLE[3:])]
    assert notes(truncated.receive(A2C, ASK, 6.0)) != []
    assert truncated.receive(C2A, b"\xcc", 7.0) == []


def test_a_frame_shorter_than_a_fragment(injector: Any) -> None:
    """A fault that changes nothing adds no note."""
    truncated = injector(rule("fragment", "size_bytes = 4") + rule("truncate", "keep_bytes = 100"))
    assert truncated.receive(A2C, ASK, 0.0) == [Forward(A2C, ASK)]


def test_coalesced_frames_are_forwarded_together(injector: Any) -> None:
    """Three at a time; fewer after the timeout."""
    together = injector(rule("coalesce", "frames = 3", "within_ms = 100", 'direction = "A2C"'))
    for _ in range(2):
        printed = together.receive(A2C, ASK, 0.0)
        assert not sent(printed, A2C)
        assert sent(together.receive(A2C, ASK_TIME, 0.0), A2C) == b""
        assert Forward(A2C, ASK + ASK_TIME + STOP) in together.receive(A2C, STOP, 0.0)
    assert sent(together.receive(A2C, ASK, 1.0), A2C) == b""
    assert together.tick(1.1) == [
        InjectionNote(A2C, "get_status request at bytes 24-27: passed on after 100 ms"),
        Forward(A2C, ASK),
    ]


def test_hold_back_until_a_command(injector: Any) -> None:
    """The command may come from either side; the note states when the frame was forwarded."""
    hold = 'until_command = "emergency_stop"'
    held = injector(rule("hold-back", 'part = "result"', hold, "at_most_ms = 60_000"))
    assert held.receive(A2C, STOP, 0.0) == [Forward(A2C, STOP)]
    assert notes(held.receive(C2A, RESULT, 1.0)) == [
        (
            "run_program result at bytes 0-5: rule 1: held back until emergency_stop frame, "
            "60000 ms at most"
        )
    ]
    assert held.receive(A2C, ASK, 2.0) == [Forward(A2C, ASK)]
    assert held.receive(A2C, STOP, 3.5) == [
        InjectionNote(C2A, "run_program result at bytes 0-5: passed on after 2500 ms"),
        Forward(A2C, STOP),
        Forward(C2A, RESULT),
    ]
    held.receive(C2A, RESULT, 4.0)
    assert held.next_s == 64.0
    assert sent(held.tick(64.0), C2A) == RESULT


def test_drop_truncate_and_corrupt(injector: Any) -> None:
    """Each changes only its frame and adds a note."""
    damaged = injector(
        rule("drop", "command = 0x70")
        + rule("truncate", "keep_bytes = 3", 'command = "get_time"')
        + rule("corrupt", "at_bytes = -1", "xor = 0xFF", 'command = "emergency_stop"')
    )
    actions = damaged.receive(A2C, b"".join((ASK, UNDEFINED, ASK_TIME, STOP, ASK)), 0.0)
    assert sent(actions, A2C) == ASK + ASK_TIME[:3] + STOP[:-1] + b"\x33" + ASK
    assert notes(actions) == [
        "0x70 request at bytes 4-8: rule 1: not passed on",
        "get_time request at bytes 9-12: rule 2: only its first 3 bytes passed on",
        "emergency_stop request at bytes 13-16: rule 3: its byte 3 changed by xor 0xFF",
    ]


def test_corruption_always_changes_one_byte(injector: Any) -> None:
    """At any position; a position after the end of the frame is invalid."""
    anywhere = injector(rule("corrupt"))
    for _ in range(200):
        changed = sent(anywhere.receive(A2C, UNDEFINED, 0.0), A2C)
        assert sum(a != b for a, b in zip(changed, UNDEFINED, strict=True)) == 1
    assert injector(rule("corrupt", "at_bytes = 4")).receive(A2C, ASK, 0.0) == [Forward(A2C, ASK)]
    assert injector(rule("corrupt", "at_bytes = -5")).receive(A2C, ASK, 0.0) == [Forward(A2C, ASK)]


def test_a_reset_replaces_its_frame(injector: Any) -> None:
    """Earlier bytes are forwarded; later bytes are discarded."""
    cut = injector(rule("reset", 'command = "emergency_stop"'))
    assert cut.receive(A2C, ASK + STOP + ASK, 0.0) == [
        InjectionNote(
            A2C, "emergency_stop request at bytes 4-7: rule 1: the connection cut instead"
        ),
        Forward(A2C, ASK),
        ResetBoth(A2C),
    ]
    assert cut.receive(C2A, IDLE, 0.0) == []
    assert cut.flush() == []


def test_all_matching_rules_are_applied(injector: Any) -> None:
    """Rules are applied in their order, and each adds a note."""
    both = injector(rule("delay", "delay_ms = 5") + rule("delay", "delay_ms = 7") + rule("drop"))
    assert len(notes(both.receive(A2C, ASK, 0.0))) == 3
    assert both.next_s == pytest.approx(0.012)
    assert both.tick(1.0) == []


def test_delayed_frames_at_the_end_of_the_connection(injector: Any) -> None:
    """They are forwarded at once, then a partial frame; with a note."""
    late = injector(rule("delay", "delay_ms = 1000", 'direction = "C2A"'))
    late.receive(C2A, IDLE + IDLE[:3], 0.0)
    assert late.flush() == [
        InjectionNote(C2A, "the connection ends: 6 bytes that waited are passed on at once"),
        Forward(C2A, IDLE + IDLE[:3]),
    ]


def test_a_partial_frame_has_a_timeout(injector: Any) -> None:
    """The receiver sees the pause; the rest is forwarded as invalid bytes."""
    drop = injector(rule("drop"))
    assert drop.receive(A2C, UNDEFINED[:3], 1.0) == []
    assert drop.next_s == 1.0 + PARTIAL_FRAME_S
    assert drop.tick(drop.next_s) == [Forward(A2C, UNDEFINED[:3])]
    assert sent(drop.receive(A2C, UNDEFINED[3:], 9.0), A2C) == UNDEFINED[3:]
    assert drop.next_s == math.inf


@pytest.mark.parametrize(
    ("pick", "hit"),
    [
        ("", [1, 2, 3, 4, 5, 6]),
        ("nth = 2", [2]),
        ("every = 2", [2, 4, 6]),
        ("first = 2", [1, 2]),
        ("probability = 1", [1, 2, 3, 4, 5, 6]),
        ("connection = 2", []),
        ("connection = 1\nevery = 5", [5]),
        ('direction = "C2A"', []),
        ('part = "reply"', []),
        ('command = "get_time"\nnth = 3', []),
        ("command = 9\nnth = 3", [3]),
    ],
)
def test_frame_selection(injector: Any, pick: str, hit: list[int]) -> None:
    """Only frames that match the conditions are counted."""
    drop = injector(rule("drop", pick))
    hits = [n for n in range(1, 7) if not sent(drop.receive(A2C, ASK, n), A2C)]
    assert hits == hit


def test_other_frames_do_not_count(injector: Any) -> None:
    """Other requests between two statuses do not count; each connection has its own count."""
    text = rule("drop", 'command = "get_status"', 'part = "request"', "nth = 2")
    for number in (1, 2):
        drop = injector(text, number)
        drop.receive(A2C, ASK + ASK_TIME + STOP, 0.0)
        drop.receive(C2A, IDLE, 0.0)
        assert not sent(drop.receive(A2C, ASK, 0.0), A2C)


def test_probability(injector: Any) -> None:
    """Reproducible with the same seed, different with another seed."""

    def hits(seed: int) -> list[int]:
        drop = injector(f"seed = {seed}\n" + rule("drop", "probability = 0.25"))
        return [n for n in range(1000) if not sent(drop.receive(A2C, ASK, 0.0), A2C)]

    assert 200 < len(hits(1)) < 300
    assert hits(1) == hits(1) != hits(2)


@pytest.mark.parametrize("fault", sorted(injection_file._FAULTS))
def test_notes_contain_no_payload(load: Load, fault: str) -> None:
    """A password is only in the raw bytes, which can be redacted."""
    measures = {
        "delay": ("delay_ms = 1",),
        "jitter": ("jitter_ms = 1",),
        "fragment": ("size_bytes = 2",),
        "coalesce": ("frames = 2", "within_ms = 1"),
        "truncate": ("keep_bytes = 5",),
        "hold-back": ("at_most_ms = 1", "until_command = 1"),
    }
    follows = Injector(load(rule(fault, *measures.get(fault, ()))), 1)
    login = Frame(A2C, 0x01, b"sesame").encode()
    printed = notes(follows.receive(A2C, login, 0.0)) + notes(follows.tick(1.0))
    assert printed
    assert all("login request at bytes 0-9" in note and "sesame" not in note for note in printed)
