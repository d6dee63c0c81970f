"""Each trigger fires once for its condition, and for nothing else."""

from collections.abc import Callable, Iterable
from contextlib import suppress
from datetime import datetime
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from scaraspec.judge.judge import Judge
from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.direction import A2C, C2A
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.payloads import Acceptance, Outcome
from scaraspec.traffic.wire import Kind, WireEvent
from scaraspec_recorder.recordings.triggers import Trigger, TriggerError, UserTrigger, parse_trigger
from scaraspec_recorder.units import SECOND_NS


def reply(name: str, data: bytes) -> bytes:
    return Frame(C2A, BY_NAME[name].opcode, data).encode()


def feed(watcher: Trigger, events: Iterable[WireEvent], judge: Judge | None = None) -> list[str]:
    """Return the reasons each time that the trigger fires."""
    judge = judge or Judge()
    reported = []
    for event in events:
        reported.append(watcher.on_event(event))
        reported += [watcher.on_item(item) for item in judge.feed(event)]
    return [why for why in reported if why]


def fires(text: str, events: Iterable[WireEvent]) -> list[str]:
    return feed(parse_trigger(text), events)


@pytest.fixture
def session(talk: Any) -> Any:
    """Return a conversation after its login."""
    talk.mark(A2C, Kind.OPENED)
    talk.ask("login", b"password", reply=True)
    return talk


def test_a_code_fires_in_a_refusal_a_result_and_a_new_status(session: Any) -> None:
    """An unchanged status fires once."""
    for status in ("00", "12", "12", "12", "00", "12"):
        session.ask("get_status", None, status)
    session.ask("reset", None, Acceptance(accepted=False, code="12"))
    session.ask("reset", None, Acceptance(accepted=True))
    session.result("reset", Outcome(done=False, code="12"))
    assert fires("code:12", session.events) == [
        "get_status: 12 motor fault: outer arm",
        "get_status: 12 motor fault: outer arm",
        "reset: refused 12 motor fault: outer arm",
        "reset: failed 12 motor fault: outer arm",
    ]
    assert fires("code:13", session.events) == []


def test_a_code_in_upper_or_lower_case(session: Any) -> None:
    """1a is 1A (A-T-7)."""
    session.ask("get_status", None, "1A")
    assert len(fires("code:1a", session.events)) == 1


def test_refusal(session: Any) -> None:
    """A refusing first reply of any command; a failed result is not a refusal."""
    session.ask("set_time", datetime(2026, 11, 20), reply=False)  # noqa: DTZ001 - the robot's clock knows no zone
    session.ask("reset", None, Acceptance(accepted=False, code="01"))
    session.ask("reset", None, Acceptance(accepted=True))
    session.result("reset", Outcome(done=False, code="12"))
    assert fires("refusal", session.events) == [
        "set_time: refused",
        "reset: refused 01 running a program",
    ]


def test_a_finding_fires_by_requirement_or_by_verdict(session: Any) -> None:
    """Only a violation of the named requirement, or any finding with the named verdict."""
    session.send(C2A, b"\x00noise")
    session.ask("get_status", None, "00")
    (why,) = fires("finding:fail", session.events)
    assert why.startswith("fail 3/32: ")
    assert fires("finding:3/32", session.events) == [why]
    assert fires("finding:4.15/3", session.events) == []
    assert fires("finding:inconclusive", session.events) == []


def test_malformed(session: Any) -> None:
    """Invalid bytes, or a frame with an invalid payload."""
    session.send(C2A, b"\x00noise")
    session.ask("get_status", None, "00")
    session.ask("get_status")
    session.send(C2A, reply("get_status", b"ZZ"))
    found = fires("malformed", session.events)
    assert len(found) == 2
    assert "00 6E 6F 69 73 65" in found[0]
    assert found[1] == "get_status: code 'ZZ' is not a code of table 8-1"


def test_a_frame_next_to_a_gap_is_not_malformed(session: Any) -> None:
    """The recording lost a part of it."""
    complete = reply("get_status", b"00")
    session.send(C2A, complete[:2])
    session.mark(C2A, Kind.GAP, "overflow", length=2)
    session.send(C2A, complete[4:])
    session.ask("get_status", None, "00")
    assert fires("malformed", session.events) == []


@pytest.mark.parametrize("kind", [Kind.CLOSED, Kind.RESET])
def test_disconnect(session: Any, kind: Kind) -> None:
    """A close or a reset; a half-close is not a disconnect."""
    session.mark(A2C, Kind.HALF_CLOSED)
    session.mark(C2A, kind)
    assert fires("disconnect", session.events) == [f"connection 1 {kind.value}"]


def test_gap(talk: Any) -> None:
    """Its length is given if it is known."""
    talk.mark(C2A, Kind.GAP, "overflow", length=37)
    talk.mark(A2C, Kind.GAP, "restart", length=-1)
    assert fires("gap", talk.events) == [
        "connection 1: 37 bytes are not recorded: overflow",
        "connection 1: an unknown number of bytes are not recorded: restart",
    ]


def test_the_end_of_the_recording_is_not_a_disconnect(session: Any) -> None:
    """Open connections are closed after gaps of unknown length."""
    for direction in (A2C, C2A):
        session.mark(direction, Kind.GAP, "the recording ended", length=-1)
    session.mark(A2C, Kind.CLOSED, "the recording ended")
    assert fires("disconnect", session.events) == []


def test_silence_fires_once_and_again_after_the_next_byte(session: Any) -> None:
    """Silence is detected at a tick, for every open connection."""
    watcher = parse_trigger("silence:30s")
    feed(watcher, session.events)
    quiet_ns = session.time_ns
    ticks = [watcher.on_time(quiet_ns + seconds * SECOND_NS) for seconds in (1, 29, 30, 31, 90)]
    assert ticks == ["", "", "no bytes on connection 1 for 30.0 s", "", ""]
    session.time_ns += 100 * SECOND_NS
    session.send(A2C, b"\xaa\x09\x00\xcc")
    assert feed(watcher, session.events[-1:]) == []
    assert watcher.on_time(session.time_ns + 30 * SECOND_NS)
    session.mark(A2C, Kind.CLOSED)
    feed(watcher, session.events[-1:])
    assert watcher.on_time(session.time_ns + 300 * SECOND_NS) == ""


def test_silence_is_detected_at_the_next_byte(session: Any) -> None:
    """Without a tick in time, the next byte shows the duration."""
    session.time_ns += 31 * SECOND_NS
    session.send(A2C, b"\xaa\x09\x00\xcc")
    assert fires("silence:30s", session.events) == ["no bytes on connection 1 for 31.0 s"]


def test_a_late_opened_event_is_not_silence(talk: Any) -> None:
    """Silence counts from the first known time."""
    talk.mark(A2C, Kind.OPENED)
    watcher = parse_trigger("silence:30s")
    feed(watcher, talk.events)
    assert watcher.on_time(talk.time_ns + 3600 * SECOND_NS) == ""
    assert watcher.on_time(talk.time_ns + 3630 * SECOND_NS)


def test_a_late_reply_fires_when_it_comes(session: Any) -> None:
    """The latency is from the last byte of the request to the first byte of the reply."""
    session.ask("get_status", None, "00")
    session.ask("get_status")
    session.send(C2A, reply("get_status", b"00"), after_s=0.6)
    assert fires("late:500ms", session.events) == ["get_status answered after 600 ms"]
    assert fires("late:700ms", session.events) == []


def test_a_missing_reply_fires_at_a_tick(session: Any) -> None:
    """The reply does not fire again."""
    session.ask("get_status")
    request_ns = session.time_ns
    session.send(C2A, reply("get_status", b"00"), after_s=0.9)
    watcher, judge = parse_trigger("late:500ms"), Judge()
    assert feed(watcher, session.events[:-1], judge) == []
    assert watcher.on_time(request_ns + 500_000_000) == ""
    assert watcher.on_time(request_ns + 750_000_000) == "get_status not answered for 750 ms"
    assert watcher.on_time(request_ns + 800_000_000) == ""
    assert feed(watcher, session.events[-1:], judge) == []


def test_a_reply_hidden_by_a_gap_is_not_late(session: Any) -> None:
    """It is unknown whether it arrived; the same at the end of the connection."""
    for last in (Kind.GAP, Kind.CLOSED):
        watcher = parse_trigger("late:500ms")
        session.ask("get_status")
        session.mark(C2A, last, length=3 if last is Kind.GAP else 0)
        feed(watcher, session.events)
        assert watcher.on_time(session.time_ns + 9 * SECOND_NS) == ""


def test_a_signal_fires_at_the_next_tick() -> None:
    """The trigger fires once for each request."""
    watcher = parse_trigger("signal")
    assert isinstance(watcher, UserTrigger)
    assert watcher.on_time(1) == ""
    watcher.request()
    assert [watcher.on_time(2), watcher.on_time(3)] == ["requested by SIGUSR1", ""]


def test_triggers_in_a_shift(shift: list[WireEvent]) -> None:
    """One refusal, one fault, one run of invalid bytes, one end."""
    counts = {
        text: len(fires(text, shift))
        for text in ("refusal", "code:12", "malformed", "disconnect", "finding:fail", "late:1s")
    }
    assert counts == {
        "refusal": 1,
        "code:12": 1,
        "malformed": 1,
        "disconnect": 1,
        "finding:fail": 1,
        "late:1s": 0,
    }


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "'' is not a trigger: use code:12, refusal, "),
        ("refusal:now", "'refusal:now' is not a trigger: use code:12, refusal, "),
        ("code", "'' is not a code of table 8-1, such as 12"),
        ("code:ZZ", "'ZZ' is not a code of table 8-1, such as 12"),
        ("silence:soon", "'silence:soon' is not a trigger: 'soon' is not a duration such as 500ms"),
        ("late", "'late' is not a trigger: '' is not a duration such as 500ms"),
        ("finding:4.15/99", "There is no requirement '4.15/99'; "),
        ("finding:pass", "There is no requirement 'pass'; "),
    ],
)
def test_an_invalid_trigger(text: str, sentence: str) -> None:
    """One sentence: the error and the valid triggers."""
    with pytest.raises(TriggerError) as caught:
        parse_trigger(text)
    assert str(caught.value).startswith(sentence)
    assert "\n" not in str(caught.value)


@given(
    st.text() | st.tuples(st.sampled_from(["code:", "finding:", "late:"]), st.text()).map("".join)
)
def test_any_text(text: str) -> None:
    """The text is a trigger or an error."""
    with suppress(TriggerError):
        assert isinstance(parse_trigger(text), Trigger)


@given(st.lists(st.binary(max_size=12), max_size=12))
def test_any_bytes(new_talk: Callable[..., Any], pieces: list[bytes]) -> None:
    """No trigger raises an exception."""
    talk = new_talk()
    talk.mark(A2C, Kind.OPENED)
    for number, piece in enumerate(pieces):
        talk.send((A2C, C2A)[number % 2], piece)
    talk.mark(A2C, Kind.CLOSED)
    for text in ("code:12", "refusal", "finding:fail", "silence:1s", "late:1s", "malformed"):
        fires(text, talk.events)
