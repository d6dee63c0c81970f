"""Faults on purpose: done to the frames that are meant, told each time, and never out of order."""

import asyncio
import gc
import math
import socket
import struct
import tomllib
from collections import Counter
from collections.abc import Awaitable, Callable, Iterable
from dataclasses import replace
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any, Self

import pytest
from hypothesis import given
from hypothesis import strategies as st

from scaraspec.judgement.happenings import Injected
from scaraspec.judgement.judge import Judge
from scaraspec.judgement.verdicts import Finding, Verdict
from scaraspec.judgement.wire import Kind, WireEvent
from scaraspec.protocol.commands import BY_NAME, COMMANDS
from scaraspec.protocol.direction import A2C, C2A, Direction
from scaraspec.protocol.frames import Frame
from scaraspec.report.session import SessionStats
from scaraspec_recorder import inject, tcp, wording
from scaraspec_recorder import tap as tap_module
from scaraspec_recorder.capture import capture_sink
from scaraspec_recorder.inject import InjectionError, load_injection
from scaraspec_recorder.injection import connection as connection_module
from scaraspec_recorder.injection.connection import InjectedConnection
from scaraspec_recorder.injection.injector import (
    PATIENCE_S,
    Action,
    Cut,
    Ended,
    Forward,
    Injector,
    Told,
)
from scaraspec_recorder.injection.rules import Injection
from scaraspec_recorder.mcap_reading import read_mcap
from scaraspec_recorder.recording import record
from scaraspec_recorder.records import Record
from scaraspec_recorder.routes import Upstream
from scaraspec_recorder.tap import Connection, Tap
from scaraspec_recorder.unspool import Count, Unspooler

TIMEOUT_S = 20
SAMPLES = sorted((Path(__file__).parents[2] / "fixtures" / "injection").glob("*.toml"))

ASK = Frame(A2C, 0x09).encode()  # get_status
IDLE = Frame(C2A, 0x09, b"00").encode()
ASK_TIME = Frame(A2C, 0x07).encode()
STOP = Frame(A2C, 0x32).encode()
RESULT = Frame(C2A, 0x30, b"1", tagged=True).encode()
UNDEFINED = Frame(A2C, 0x70, b"x").encode()

Load = Callable[[str], Injection]


@pytest.fixture
def load(tmp_path: Path) -> Load:
    """Reads a file of this text."""

    def load_text(text: str) -> Injection:
        path = tmp_path / "faults.toml"
        path.write_text(text)
        return load_injection(path)

    return load_text


@pytest.fixture
def injector(load: Load) -> Callable[..., Injector]:
    """Follows a connection by the rules of a text, each begun for it by a word."""

    def make(text: str, connection: int = 1) -> Injector:
        return Injector(load(text), connection)

    return make


def rule(fault: str, *lines: str) -> str:
    return "\n".join((f'[[rule]]\nfault = "{fault}"', *lines, ""))


def sent(actions: Iterable[Action], direction: Direction) -> bytes:
    return b"".join(a.data for a in actions if isinstance(a, Forward) and a.direction is direction)


def notes(actions: Iterable[Action]) -> list[str]:
    return [action.note for action in actions if isinstance(action, Told)]


def run_out(injector: Injector) -> list[tuple[float, Action]]:
    """Let time pass until nothing waits."""
    done = []
    for _ in range(100_000):
        if (now_s := injector.next_s) == math.inf:
            return done
        done += [(now_s, action) for action in injector.tick(now_s)]
    raise AssertionError("something waits for ever")


# What goes in comes out.

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
def test_without_a_hit_every_byte_goes_on_in_order(
    stream: list[tuple[Direction, bytes, float]],
) -> None:
    """Frames, pieces of frames and noise, split anyhow: all of it, unchanged, and nothing told."""
    injector = Injector(Injection(()), 1)
    now_s, actions = 0.0, []
    for direction, data, after_s in stream:
        now_s += after_s
        if injector.next_s <= now_s:
            actions += injector.tick(now_s)
        actions += injector.receive(direction, data, now_s)
    for direction in Direction:
        actions += injector.finish(direction, now_s)
        whole = b"".join(data for way, data, _ in stream if way is direction)
        assert sent(actions, direction) == whole
    assert notes(actions) == []
    assert [a for a in actions if isinstance(a, Ended)] == [Ended(A2C), Ended(C2A)]


@given(arrivals, st.sets(st.sampled_from(ORDERLY)), st.integers(0, 5))
def test_faults_in_time_keep_all_bytes_and_their_order(
    stream: list[tuple[Direction, bytes, float]], rules: set[str], seed: int
) -> None:
    """Whatever is late, in pieces or held back: the stream is the same, and its end its last."""
    table = tomllib.loads(f"seed = {seed}\n{''.join(sorted(rules))}")
    injector = Injector(inject._injection({"rule": [], **table}), 1)
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
        mine = [a for a in actions if a.direction is direction and not isinstance(a, Told)]
        assert sent(mine, direction) == b"".join(d for way, d, _ in stream if way is direction)
        assert mine[-1] == Ended(direction)
        assert injector.waiting_bytes(direction) == 0


@given(arrivals, st.sampled_from(SAMPLES), st.integers(0, 30))
def test_an_end_lets_everything_go(
    stream: list[tuple[Direction, bytes, float]], sample: Path, count: int
) -> None:
    """After a flush nothing waits, nothing comes, and there is nothing left to call back for."""
    injector = Injector(load_injection(sample), 1)
    for direction, data, _ in stream[:count]:
        injector.receive(direction, data, 0.0)
    injector.flush()
    assert injector.next_s == math.inf
    assert injector.flush() == []
    for direction, data, _ in stream[count:]:
        assert injector.receive(direction, data, 1.0) == []


# What each fault does.


def test_a_delay_holds_a_frame_and_what_is_behind_it(injector: Any) -> None:
    """Nothing overtakes; both are told of, with their place."""
    late = injector(rule("delay", "delay_ms = 250", 'command = "get_status"', 'part = "reply"'))
    assert late.receive(A2C, ASK, 1.0) == [Forward(A2C, ASK)]
    assert late.receive(C2A, IDLE, 1.0) == [
        Told(C2A, "get_status reply at bytes 0-5: rule 1: 250 ms late")
    ]
    assert late.receive(C2A, RESULT, 1.1) == [
        Told(C2A, "run_program result at bytes 6-11: waits behind what is held up")
    ]
    assert late.next_s == 1.25
    assert late.tick(1.249) == []
    assert late.tick(1.25) == [Forward(C2A, IDLE + RESULT)]


def test_jitter_is_the_same_again_and_apart_for_each_connection(injector: Any) -> None:
    """The seed alone decides, not what happens elsewhere."""
    text = "seed = 5\n" + rule("jitter", "jitter_ms = 100")

    def waits(connection: int) -> list[str]:
        follows = injector(text, connection)
        return notes(follows.receive(A2C, ASK * 5, 0.0))

    assert waits(1) == waits(1)
    assert waits(1) != waits(2)
    assert len(set(waits(1))) == 5


def test_fragments_are_apart_however_late_the_clock(injector: Any) -> None:
    """The gap counts from when the piece before really went."""
    torn = injector(rule("fragment", "size_bytes = 3", "gap_ms = 10"))
    (told, first) = torn.receive(C2A, IDLE, 0.0)
    assert told.note.endswith("rule 1: in pieces of 3 bytes, 10 ms apart")
    assert first == Forward(C2A, IDLE[:3])
    assert torn.next_s == 0.01
    assert torn.tick(5.0) == [Forward(C2A, IDLE[3:])]
    assert notes(torn.receive(A2C, ASK, 6.0)) != []
    assert torn.receive(C2A, b"\xcc", 7.0) == []


def test_a_frame_that_is_no_longer_than_a_piece_is_left_alone(injector: Any) -> None:
    """Where nothing was done, nothing is told."""
    torn = injector(rule("fragment", "size_bytes = 4") + rule("truncate", "keep_bytes = 100"))
    assert torn.receive(A2C, ASK, 0.0) == [Forward(A2C, ASK)]


def test_coalesced_frames_go_as_one_piece(injector: Any) -> None:
    """Three by three; what is too few goes when its time is over."""
    together = injector(rule("coalesce", "frames = 3", "within_ms = 100", 'direction = "A2C"'))
    for _ in range(2):
        told = together.receive(A2C, ASK, 0.0)
        assert not sent(told, A2C)
        assert sent(together.receive(A2C, ASK_TIME, 0.0), A2C) == b""
        assert Forward(A2C, ASK + ASK_TIME + STOP) in together.receive(A2C, STOP, 0.0)
    assert sent(together.receive(A2C, ASK, 1.0), A2C) == b""
    assert together.tick(1.1) == [
        Told(A2C, "get_status request at bytes 24-27: passed on after 100 ms"),
        Forward(A2C, ASK),
    ]


def test_what_is_held_back_goes_when_the_other_side_has_spoken(injector: Any) -> None:
    """The condition may come from either side; it is told when the frame went."""
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
        Told(C2A, "run_program result at bytes 0-5: passed on after 2500 ms"),
        Forward(A2C, STOP),
        Forward(C2A, RESULT),
    ]
    held.receive(C2A, RESULT, 4.0)
    assert held.next_s == 64.0
    assert sent(held.tick(64.0), C2A) == RESULT


def test_drop_truncate_and_corrupt_change_what_goes_and_tell_it(injector: Any) -> None:
    """And nothing else: what is around them goes on as it came."""
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
    """Wherever it falls; a place beyond the frame's end is none."""
    anywhere = injector(rule("corrupt"))
    for _ in range(200):
        changed = sent(anywhere.receive(A2C, UNDEFINED, 0.0), A2C)
        assert sum(a != b for a, b in zip(changed, UNDEFINED, strict=True)) == 1
    assert injector(rule("corrupt", "at_bytes = 4")).receive(A2C, ASK, 0.0) == [Forward(A2C, ASK)]
    assert injector(rule("corrupt", "at_bytes = -5")).receive(A2C, ASK, 0.0) == [Forward(A2C, ASK)]


def test_a_reset_comes_in_the_place_of_its_frame(injector: Any) -> None:
    """What was before it still goes; what comes after is nobody's."""
    cut = injector(rule("reset", 'command = "emergency_stop"'))
    assert cut.receive(A2C, ASK + STOP + ASK, 0.0) == [
        Told(A2C, "emergency_stop request at bytes 4-7: rule 1: the connection cut instead"),
        Forward(A2C, ASK),
        Cut(A2C),
    ]
    assert cut.receive(C2A, IDLE, 0.0) == []
    assert cut.flush() == []


def test_all_rules_that_hit_are_done(injector: Any) -> None:
    """In their order, and each is told."""
    both = injector(rule("delay", "delay_ms = 5") + rule("delay", "delay_ms = 7") + rule("drop"))
    assert len(notes(both.receive(A2C, ASK, 0.0))) == 3
    assert both.next_s == pytest.approx(0.012)
    assert both.tick(1.0) == []


def test_what_waits_goes_when_the_connection_ends(injector: Any) -> None:
    """At once, an unfinished frame behind it; that is told."""
    late = injector(rule("delay", "delay_ms = 1000", 'direction = "C2A"'))
    late.receive(C2A, IDLE + IDLE[:3], 0.0)
    assert late.flush() == [
        Told(C2A, "the connection ends: 6 bytes that waited are passed on at once"),
        Forward(C2A, IDLE + IDLE[:3]),
    ]


def test_an_unfinished_frame_does_not_wait_for_ever(injector: Any) -> None:
    """Its receiver is to see the silence; its rest goes on too, and is no frame."""
    drop = injector(rule("drop"))
    assert drop.receive(A2C, UNDEFINED[:3], 1.0) == []
    assert drop.next_s == 1.0 + PATIENCE_S
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
def test_which_frames_are_hit(injector: Any, pick: str, hit: list[int]) -> None:
    """Counted among those that are meant: others between them do not count."""
    drop = injector(rule("drop", pick))
    hits = [n for n in range(1, 7) if not sent(drop.receive(A2C, ASK, n), A2C)]
    assert hits == hit


def test_others_do_not_count(injector: Any) -> None:
    """The second status is the second, whatever else was asked; each connection counts anew."""
    text = rule("drop", 'command = "get_status"', 'part = "request"', "nth = 2")
    for number in (1, 2):
        drop = injector(text, number)
        drop.receive(A2C, ASK + ASK_TIME + STOP, 0.0)
        drop.receive(C2A, IDLE, 0.0)
        assert not sent(drop.receive(A2C, ASK, 0.0), A2C)


def test_probability_is_about_that(injector: Any) -> None:
    """And the same again with the same seed, another with another."""

    def hits(seed: int) -> list[int]:
        drop = injector(f"seed = {seed}\n" + rule("drop", "probability = 0.25"))
        return [n for n in range(1000) if not sent(drop.receive(A2C, ASK, 0.0), A2C)]

    assert 200 < len(hits(1)) < 300
    assert hits(1) == hits(1) != hits(2)


@pytest.mark.parametrize("fault", sorted(inject._FAULTS))
def test_notes_hold_no_payload(load: Load, fault: str) -> None:
    """A password is in no record but the raw bytes, which can be redacted."""
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
    told = notes(follows.receive(A2C, login, 0.0)) + notes(follows.tick(1.0))
    assert told
    assert all("login request at bytes 0-9" in note and "sesame" not in note for note in told)


# Files.


@pytest.mark.parametrize("path", SAMPLES, ids=lambda path: path.stem)
def test_the_samples_can_be_read(path: Path) -> None:
    """Each has rules, and the README names it."""
    assert load_injection(path).rules
    assert f"`{path.name}`" in (path.parent / "README.md").read_text()


def test_the_samples_show_every_fault() -> None:
    """So that nobody has to guess how one is written."""
    shown = {type(rule.fault) for path in SAMPLES for rule in load_injection(path).rules}
    assert shown == set(inject._FAULTS.values())


def test_the_documented_file_can_be_read(load: Load) -> None:
    """What the module says is a file is one; its name is in the capture."""
    assert inject.__doc__
    lines = inject.__doc__.partition("    seed = 7")[2].partition("\nOnly")[0].splitlines()
    injection = load("seed = 7" + "\n".join(line.removeprefix("    ") for line in lines))
    assert [r.label for r in injection.rules] == ["rule 1 (slow status)"]
    assert injection.seed == 7


DELAY = '[[rule]]\nfault = "delay"\n'


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "it has no rule: begin each with a line [[rule]]"),
        ("rule = 3", "it has no rule"),
        ("rule = [3]", "it has no rule"),
        ("seeds = 3", "seeds means nothing here: take seed and [[rule]]"),
        ("seed = -1", "seed must be a whole number from 0 to 1000000000, not -1"),
        ("[[rule", "it is no TOML file: "),
        ("x = '" + "x" * (1 << 20) + "'", "it is larger than 1 MiB"),
        ("[[rule]]\n" * 300, "it has 300 rules, 256 are the most"),
        ("[[rule]]", "rule 1: fault is missing, it must be one of delay, jitter, fragment,"),
        (rule("slow"), "rule 1: fault must be one of delay, jitter"),
        ("[[rule]]\nfault = []", "rule 1: fault must be one of delay"),
        (DELAY, "rule 1: delay_ms is missing, delay needs a number above 0, 3.6e+06 at most"),
        (DELAY + "delay_ms = 0", "rule 1: delay_ms must be a number above 0, 3.6e+06 at most, not"),
        (DELAY + "delay_ms = nan", "not nan"),
        (DELAY + "delay_ms = true", "not True"),
        (DELAY + "delay_ms = '5'", "not '5'"),
        (DELAY + "delay = 5", "rule 1: delay means nothing for delay: take delay_ms, fault, name,"),
        (DELAY + "xor = 5", "rule 1: xor means nothing for delay: take delay_ms"),
        (rule("drop") + rule("drop", "nth = 0"), "rule 2: nth must be a whole number from 1 to"),
        (rule("drop", "nth = 1", "first = 2"), "rule 1: nth and first do not go together"),
        (rule("drop", "probability = 2"), "probability must be a number above 0, 1 at most, not 2"),
        (rule("drop", "command = 'status'"), "command must be a command's name such as get_status"),
        (rule("drop", "command = 256"), "or an opcode from 0x00 to 0xFF, not 256"),
        (rule("drop", "command = [1]"), "or an opcode from 0x00 to 0xFF, not [1]"),
        (rule("drop", "part = 'answer'"), "part must be one of request, reply, result, not"),
        (rule("drop", "direction = 'up'"), "direction must be one of A2C, C2A, not 'up'"),
        (rule("drop", "name = 'a\\nb'", "name = 'b'"), "it is no TOML file"),
        (rule("drop", 'name = "a\\nb"'), "name must be a text of at most 60 characters, on one"),
        (
            rule("drop", "command = 'get_time'", "part = 'result'"),
            "rule 1 means no frame: get_time has no final result",
        ),
        (
            rule("drop", "command = 'download_chunk'", "part = 'request'", "direction = 'A2C'"),
            "rule 1 means no frame: the request of download_chunk goes C2A",
        ),
        (
            rule(
                "hold-back", "at_most_ms = 1", "until_command = 'get_time'", "until_part = 'result'"
            ),
            "rule 1 means no frame: get_time has no final result",
        ),
    ],
)
def test_what_is_wrong_in_a_file_is_one_sentence(load: Load, text: str, sentence: str) -> None:
    """Which file, which rule, which key, and what may stand there; nothing else is shown."""
    with pytest.raises(InjectionError) as caught:
        load(text)
    message = str(caught.value)
    assert f"faults.toml: {sentence}" in message or sentence in message.partition("rule 1: ")[2]
    assert "\n" not in message
    assert len(message) < 500


def test_a_file_that_cannot_be_read_is_one_sentence(tmp_path: Path) -> None:
    """Nor is a folder, or what is no text."""
    with pytest.raises(InjectionError, match="nowhere: it cannot be read: No such file"):
        load_injection(tmp_path / "nowhere")
    (tmp_path / "binary").write_bytes(b"\xff\xfe")
    with pytest.raises(InjectionError, match="binary: it is no TOML file"):
        load_injection(tmp_path / "binary")


def test_every_command_can_be_meant_in_every_part_that_it_has(load: Load) -> None:
    """No condition that can hold is refused."""
    for command in COMMANDS:
        parts = ("request", "reply", "result") if command.two_stage else ("request", "reply")
        for part in parts:
            load(rule("drop", f'command = "{command.name}"', f'part = "{part}"'))


# On real sockets.


class Bench:
    """A tap with faults on the present event loop, a server behind it, and all that it tells."""

    def __init__(self, injection: Injection | None) -> None:
        self.records: list[Record] = []
        self.told = asyncio.Event()
        self.server = tcp.listen("127.0.0.1", 0)
        self.server.settimeout(0)
        self._listener = tcp.listen("127.0.0.1", 0)
        self._sockets = [self.server]
        self._stopped = False
        connect = partial(InjectedConnection, injection) if injection else None
        self.tap = Tap(Upstream(*self.server.getsockname()), self.take, connect, now_ns=lambda: 7)

    async def __aenter__(self) -> Self:
        await self.tap.start(self._listener)
        return self

    async def __aexit__(self, *_: object) -> None:
        await self.stop()
        for sock in (*self._sockets, self._listener):
            sock.close()

    async def stop(self) -> None:
        if not self._stopped:
            self._stopped = True
            await self.tap.stop()

    def take(self, *fields: Any) -> None:
        self.records.append(Record(*fields))
        self.told.set()

    async def pair(self) -> tuple[socket.socket, socket.socket]:
        """A client, and the server's socket of its connection."""
        loop, client = asyncio.get_running_loop(), socket.socket()
        client.settimeout(0)
        self._sockets.append(client)
        await loop.sock_connect(client, self._listener.getsockname())
        server, _ = await loop.sock_accept(self.server)
        self._sockets.append(server)
        return client, server

    async def until(self, kind: Kind) -> Record:
        """The first record of this kind."""
        while True:
            for told in self.records:
                if told.kind is kind:
                    return told
            self.told.clear()
            await self.told.wait()

    def events(self) -> list[WireEvent]:
        """What a recording makes of all that was told."""
        return Unspooler({direction: Count() for direction in Direction}, {}).take(self.records)


@pytest.fixture(params=["uvloop", "asyncio"])
def run(request: pytest.FixtureRequest) -> Callable[[Callable[[], Awaitable[None]]], None]:
    """Run a test's coroutine on an event loop, for a bounded time."""
    factory = tap_module.new_event_loop if request.param == "uvloop" else asyncio.new_event_loop

    def run_bounded(test: Callable[[], Awaitable[None]]) -> None:
        with asyncio.Runner(loop_factory=factory) as runner:
            runner.run(asyncio.wait_for(test(), TIMEOUT_S))

    return run_bounded


async def send(sock: socket.socket, data: bytes) -> None:
    await asyncio.get_running_loop().sock_sendall(sock, data)


async def turn() -> None:
    """Let the tap have its turn: it runs on the same event loop."""
    await asyncio.sleep(0)


async def receive(sock: socket.socket, size_bytes: int) -> bytes:
    data = b""
    while len(data) < size_bytes:
        more = await asyncio.get_running_loop().sock_recv(sock, size_bytes - len(data))
        assert more, "the stream ended early"
        data += more
    return data


async def at_end(sock: socket.socket) -> bool:
    return await asyncio.get_running_loop().sock_recv(sock, 1) == b""


HOLD = rule(
    "hold-back",
    'part = "reply"',
    'until_command = "emergency_stop"',
    "at_most_ms = 3_600_000",
)


def test_off_is_the_plain_tap(run: Any) -> None:
    """Without a file no connection knows of faults."""

    async def test() -> None:
        async with Bench(None) as bench:
            client, server = await bench.pair()
            await send(client, ASK)
            assert await receive(server, len(ASK)) == ASK
            (connection,) = bench.tap._connections
            assert type(connection) is Connection
            assert type(connection.client) is tap_module.End

    run(test)


def test_recorded_is_what_came_and_what_was_done_to_it(run: Any, load: Load) -> None:
    """The fault stands behind the bytes, and no byte counts as lost."""
    injection = load(rule("drop", 'command = "get_status"', 'part = "request"', "nth = 2"))

    async def test() -> None:
        async with Bench(injection) as bench:
            client, server = await bench.pair()
            await send(client, ASK + ASK + STOP)
            assert await receive(server, 8) == ASK + STOP
            await send(server, IDLE)
            assert await receive(client, len(IDLE)) == IDLE
            for sock in (client, server):
                sock.shutdown(socket.SHUT_WR)
            await bench.until(Kind.CLOSED)
            events = bench.events()
            assert b"".join(e.data for e in events if e.direction is A2C) == ASK + ASK + STOP
            assert Kind.GAP not in {event.kind for event in events}
            (fault,) = (event for event in events if event.kind is Kind.INJECTED)
            assert (fault.connection, fault.direction, fault.offset_bytes) == ("1", A2C, 12)
            assert fault.note == "get_status request at bytes 4-7: rule 1: not passed on"

    run(test)


def test_a_delayed_frame_arrives_in_its_order(run: Any, load: Load) -> None:
    """By timers of the event loop, in both directions, every byte."""
    injection = load(rule("jitter", "jitter_ms = 3") + rule("fragment", "size_bytes = 2"))

    async def test() -> None:
        async with Bench(injection) as bench:
            client, server = await bench.pair()
            asked = [Frame(A2C, 0x0C, b"%d" % n).encode() for n in range(20)]
            for frame in asked:
                await send(client, frame)
                await send(server, IDLE)
            whole = b"".join(asked)
            assert await receive(server, len(whole)) == whole
            assert await receive(client, 20 * len(IDLE)) == 20 * IDLE

    run(test)


def test_a_frame_is_held_until_the_other_side_has_spoken(run: Any, load: Load) -> None:
    """No time passes: the condition alone lets it go."""

    async def test() -> None:
        async with Bench(load(HOLD)) as bench:
            client, server = await bench.pair()
            await send(client, ASK)
            await receive(server, len(ASK))
            await send(server, IDLE)
            await bench.until(Kind.INJECTED)
            with pytest.raises(BlockingIOError):
                client.recv(1)
            await send(client, STOP)
            assert await receive(client, len(IDLE)) == IDLE
            assert await receive(server, len(STOP)) == STOP

    run(test)


def test_an_end_waits_behind_what_is_held_up(run: Any, load: Load) -> None:
    """The other side has ended meanwhile; still the connection lives until all has been passed."""

    async def test() -> None:
        async with Bench(load(HOLD)) as bench:
            client, server = await bench.pair()
            await send(server, IDLE)
            server.shutdown(socket.SHUT_WR)
            await bench.until(Kind.INJECTED)
            await send(client, STOP)
            client.shutdown(socket.SHUT_WR)
            assert await receive(client, len(IDLE)) == IDLE
            assert await at_end(client)
            assert await receive(server, len(STOP)) == STOP
            assert await at_end(server)
            assert (await bench.until(Kind.CLOSED)).connection == 1

    run(test)


def test_stopping_passes_on_what_waits(run: Any, load: Load) -> None:
    """A recorder that ends leaves nothing behind, and says that it went early."""

    async def test() -> None:
        async with Bench(load(HOLD)) as bench:
            client, server = await bench.pair()
            await send(server, IDLE)
            await bench.until(Kind.INJECTED)
            await bench.stop()
            assert await receive(client, len(IDLE)) == IDLE
            assert await at_end(client)
            told = [r.note for r in bench.records if r.kind is Kind.INJECTED]
            assert told[-1] == "the connection ends: 6 bytes that waited are passed on at once"

    run(test)


def test_a_sender_that_resets_takes_nothing_with_it(run: Any, load: Load) -> None:
    """What was held up is passed on before the reset is."""

    async def test() -> None:
        async with Bench(load(HOLD)) as bench:
            client, server = await bench.pair()
            await send(server, IDLE)
            await bench.until(Kind.INJECTED)
            server.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
            server.close()
            assert await receive(client, len(IDLE)) == IDLE
            with pytest.raises(ConnectionResetError):
                await at_end(client)
            assert (await bench.until(Kind.RESET)).direction is C2A

    run(test)


def test_a_reset_on_purpose_reaches_both_sides(run: Any, load: Load) -> None:
    """Neither takes it for an orderly end; the capture says whose doing it was."""

    async def test() -> None:
        async with Bench(load(rule("reset", 'command = "emergency_stop"'))) as bench:
            client, server = await bench.pair()
            await send(client, ASK + STOP)
            assert await receive(server, len(ASK)) == ASK
            for sock in (client, server):
                with pytest.raises(ConnectionResetError):
                    await at_end(sock)
            await bench.tap._wait_gone()
            gc.collect()  # complains of a socket that somebody forgot, and then closes another's
            kinds = [event.kind for event in bench.events()]
            assert kinds == [Kind.OPENED, Kind.BYTES, Kind.INJECTED, Kind.RESET]
            assert (await bench.until(Kind.RESET)).note == "cut by an injected fault"

    run(test)


def test_a_sender_is_paused_where_too_much_is_held_up(
    run: Any, load: Load, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Memory is bounded, and when it goes on nothing is missing."""
    monkeypatch.setattr(connection_module, "HELD_BYTES", 1000)
    data = IDLE + Frame(C2A, 0x0D, b"a.rob").encode() * 20_000

    async def test() -> None:
        async with Bench(load(HOLD)) as bench:
            client, server = await bench.pair()
            sending = asyncio.create_task(send(server, data))
            await bench.until(Kind.INJECTED)
            (connection,) = bench.tap._connections
            while connection.upstream.transport.is_reading():
                await turn()
            assert connection._injector.waiting_bytes(C2A) <= 1000 + (256 << 10)
            receiving = asyncio.create_task(receive(client, len(data)))
            while not receiving.done():
                await send(client, STOP)
                await receive(server, len(STOP))
            assert receiving.result() == data
            await sending

    run(test)


# What a recording says of it.


def verdicts(events: Iterable[WireEvent]) -> list[tuple[Verdict, str]]:
    judge = Judge()
    items = [item for event in events for item in judge.feed(event)] + [*judge.close()]
    return [(item.verdict, item.requirement) for item in items if isinstance(item, Finding)]


def unanswered(talk: Any, *, injected: bool) -> None:
    """A request without reply, and a while after it some with."""
    talk.ask("get_version")
    if injected:
        talk.mark(A2C, Kind.INJECTED, "get_version request at bytes 14-17: rule 1: not passed on")
    for _ in range(4):
        talk.time_ns += 6_000_000_000
        talk.ask("get_status", None, "00")


def test_a_fault_on_purpose_fails_nobody(new_talk: Callable[[], Any]) -> None:
    """The same silence fails a controller that got the request; and one that gets the next."""
    failed = []
    for first, second in ((False, False), (True, False), (True, True)):
        talk = new_talk()
        talk.mark(A2C, Kind.OPENED)
        talk.ask("login", b"password", reply=True)
        unanswered(talk, injected=first)
        unanswered(talk, injected=second)
        failed.append([found for found in verdicts(talk.events) if found[0] is Verdict.FAIL])
    without, once, both = failed
    assert len(without) == 2 * len(once) > 0
    assert both == []


def test_whatever_request_is_dropped_nobody_is_blamed_for_it(shift: list[WireEvent]) -> None:
    """Login, transfer, run, stop: the controller never got it, and the client goes on as it did."""
    before = Counter(verdicts(shift))
    asked = [
        at
        for at, (event, after) in enumerate(pairwise(shift))
        if event.kind is after.kind is Kind.BYTES
        and (event.direction, after.direction) == (A2C, C2A)
    ]
    blamed = []
    for at in [*asked[:4], *asked[4:-3:40], *asked[-3:]]:
        injected = replace(shift[at], kind=Kind.INJECTED, data=b"", note="dropped")
        for told in ([injected], []):
            found = Counter(verdicts([*shift[: at + 1], *told, *shift[at + 2 :]])) - before
            if Verdict.FAIL in {verdict for verdict, _ in found}:
                blamed.append((at, told))
    assert blamed
    assert [at for at, told in blamed if told] == []


def test_a_log_says_what_was_done() -> None:
    """In the recording and in the viewer."""
    event = WireEvent(7, "3", C2A, Kind.INJECTED, note="get_status reply: rule 1: not passed on")
    assert wording.line(Injected(event)) == (
        wording.Level.WARN,
        "injected",
        "connection 3 injected: get_status reply: rule 1: not passed on",
    )


def test_a_session_counts_faults_by_connection(talk: Any) -> None:
    """And keeps the addresses."""
    talk.mark(A2C, Kind.OPENED, "a > b")
    unanswered(talk, injected=True)
    unanswered(talk, injected=True)
    judge, stats = Judge(), SessionStats()
    for event in talk.events:
        for item in judge.feed(event):
            stats.add(item)
    session = stats.session()
    assert session
    assert [c.note for c in session.connections] == ["a > b; injected faults: 2"]


def test_a_recording_holds_the_faults(load: Load, tmp_path: Path) -> None:
    """From the rule to the file, through all processes: raw bytes as sent, and each fault."""
    injection = load(rule("drop", 'part = "request"', "nth = 2"))
    status = BY_NAME["get_status"]
    sink = partial(capture_sink, session={}, draw=False)

    async def answer(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        while await reader.read(4):
            writer.write(Frame(C2A, status.opcode, b"00").encode())
        writer.close()

    async def test() -> None:
        server = await asyncio.start_server(answer, "127.0.0.1")
        route = Upstream(*server.sockets[0].getsockname())
        listen = ("127.0.0.1", 0)
        async with (
            server,
            record(route, listen, tmp_path / "out", [sink], injection=injection) as recording,
        ):
            reader, writer = await asyncio.open_connection(*recording.address)
            writer.write(ASK)
            assert await reader.readexactly(len(IDLE)) == IDLE
            writer.write(ASK + ASK)
            writer.write_eof()
            assert await reader.read() == IDLE
            writer.close()
            await writer.wait_closed()
        assert recording.progress.problems == []

    asyncio.run(asyncio.wait_for(test(), TIMEOUT_S))
    events = list(read_mcap(tmp_path / "out" / "capture.mcap"))
    assert b"".join(e.data for e in events if e.direction is A2C) == 3 * ASK
    (fault,) = (event for event in events if event.kind is Kind.INJECTED)
    assert fault.note == "get_status request at bytes 4-7: rule 1: not passed on"
