"""The short paths for repeated polls give what the general path gives."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import fields, replace
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rule_cases import SESSIONS

from scaraspec.judge.judge import Judge
from scaraspec.judge.rules import RULES
from scaraspec.protocol.direction import A2C
from scaraspec.traffic.dialogue import Dialogue
from scaraspec.traffic.events import Exchange, Transfer, UnsolicitedReply
from scaraspec.traffic.robot_state import RobotState
from scaraspec.traffic.wire import Kind, WireEvent, WireRange

Script = Callable[[str], list[WireEvent]]
_ELSEWHERE = WireRange("9", A2C, 77, 7, 12_345)


def described(value: Any, *, nested: bool = False) -> Any:
    """All fields of an item of the judge, and where the events are that they name."""
    if isinstance(value, list | tuple):
        return [described(each, nested=True) for each in value]
    if nested and isinstance(value, Exchange):
        return value.request.place
    if nested and isinstance(value, Transfer):
        return value.name, value.begun_ns
    if not isinstance(value, Exchange | Transfer | UnsolicitedReply):
        return value
    return [
        (each.name, described(getattr(value, each.name), nested=True))
        for each in fields(value)
        if each.name != "plain"
    ]


def judged(events: Iterable[WireEvent]) -> Iterator[Any]:
    """The description of each item, in order, as soon as the judge yields it; then the counts."""
    judge = Judge()
    for event in events:
        yield from map(described, judge.feed(event))
    yield from map(described, judge.close())
    yield {requirement: tally.counts for requirement, tally in judge.tallies.items()}
    yield judge.dialect_seen.counts


def exchanges(events: Iterable[WireEvent]) -> list[Exchange]:
    """The exchanges of a session."""
    judge = Judge()
    items = [item for event in events for item in judge.feed(event)]
    return [item for item in (*items, *judge.close()) if isinstance(item, Exchange)]


def judged_in_general(events: Iterable[WireEvent]) -> list[Any]:
    """The same without short paths."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Dialogue, "_is_quiet", lambda *_: False)
        return [*judged(events)]


def test_sessions_of_all_rules(script: Script) -> None:
    """Every session in the tests of the rules, with several connections, gaps and faults."""
    for session in SESSIONS:
        events = script(session)
        assert [*judged(events)] == judged_in_general(events), session


POLLING = """
    login
    > get_status
    < get_status 00
    > get_joint_angles
    < get_joint_angles 1|2|3|4
    > run_program a.rob
    < run_program 1
    > get_status
    < get_status 01
    > list_programs
    < list_programs 1|a.rob
    > get_status
    < list_programs 0|b.rob
    < get_status 01
    > get_version
    > get_status
    < get_version 1.0
    < get_status 00
    > get_status
    < get_status 00
    > get_joint_angles
    < get_joint_angles 1|2|3|4
    <90 run_program 11
    > get_status
    < get_status 00
    > get_version
    < get_version 1.0
"""


def with_gap(event: WireEvent) -> WireEvent:
    """Return a gap in the place of the bytes of an event."""
    return replace(event, kind=Kind.GAP, data=b"", length_bytes=len(event.data), note="lost")


@settings(max_examples=150)
@given(st.data())
def test_mixed_sessions(script: Script, data: st.DataObject) -> None:
    """Polls with gaps, delays and the events of another session."""
    polls, other = script(POLLING), script(data.draw(st.sampled_from(SESSIONS)))
    delays = st.sampled_from([0, 0, 0, 50_000_000, 400_000_000, 11_000_000_000])
    delay_ns = 0
    delayed = []
    for event in polls:
        delay_ns += data.draw(delays)
        lost = event.kind is Kind.BYTES and not data.draw(st.integers(0, 11))
        moved = replace(event, connection=f"p{event.connection}", time_ns=event.time_ns + delay_ns)
        delayed.append(with_gap(moved) if lost else moved)
    mixed = sorted((*delayed, *other), key=lambda event: event.time_ns)
    assert [*judged(mixed)] == judged_in_general(mixed)


def test_rules_by_bytes(script: Script) -> None:
    """A rule that is declared `by_bytes` ignores times, places and the state of the robot."""
    rules = [rule for rule in RULES if rule.by_bytes and rule.on is Exchange]
    tried: Counter[str] = Counter()
    for exchange in (x for session in SESSIONS for x in exchanges(script(session)) if x.plain):
        assert exchange.reply
        elsewhere = replace(
            exchange,
            request=replace(exchange.request, place=_ELSEWHERE, begun_ns=1, pause_ns=5),
            reply=replace(exchange.reply, place=_ELSEWHERE, begun_ns=9, pause_ns=5),
            state_version=99,
        )
        for rule in rules:
            if rule.applies_to(exchange):
                here, there = rule.check(exchange, RobotState()), rule.check(elsewhere, _busy())
                assert (here and here._replace(places=())) == (there and there._replace(places=()))
                tried[rule.requirement] += 1
    assert len(tried) > len({rule.requirement for rule in rules}) / 2
    assert min(tried.values()) > 1


def _busy() -> RobotState:
    """The state of a robot about which much is uncertain."""
    robot = RobotState()
    robot.bytes_missing = robot.fault_injected = True
    robot.forget_after_gap(1)
    return robot
