"""The judge as a whole: rules, pieces of any size, gaps, several controllers."""

from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import chain
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rule_cases import CASES, SESSIONS, TABLES

from scaraspec.judge.judge import Judge
from scaraspec.judge.requirements import REQUIREMENTS
from scaraspec.judge.rules import RULES
from scaraspec.judge.rules.rule import Check, Rule, RuleResult, kind_of
from scaraspec.judge.verdicts import Conclusion, Finding, Verdict
from scaraspec.protocol.commands import parse_frame
from scaraspec.protocol.direction import A2C, Direction
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.readings import READINGS
from scaraspec.traffic.events import FrameSeen
from scaraspec.traffic.robot_state import RobotState
from scaraspec.traffic.wire import Kind, WireEvent, WireRange

Script = Callable[[str], list[WireEvent]]
Judged = Callable[..., Any]
Recut = Callable[[Iterable[WireEvent], Callable[[], int]], Iterable[WireEvent]]

WITHOUT_GAPS = [s for s in SESSIONS if " gap" not in s]
"""After a gap, whole packets show that a stream is in sync, and pieces of them do not."""
PASSES_ONLY = dict(chain.from_iterable(table.get("PASSES_ONLY", {}).items() for table in TABLES))
"""Requirements that no capture can violate, and the reason."""


NEVER_PASSES = {
    "3/33": "a capture does not show which reply a client takes for its own",
    "7/3": "numbers alone do not show which angle they describe",
}
"""Requirements that no capture shows to be kept, and why."""


def label(rule: Rule) -> str:
    """A name that is unique for each rule."""
    check = getattr(rule.check, "func", rule.check)
    names = " ".join(sorted(rule.names))
    return f"{rule.requirement} {check.__name__}, on {rule.on.__name__} {names}"


@dataclass(frozen=True)
class AllResults:
    """The results of all rules for all cases: their verdicts, and the results for equal frames."""

    verdicts: dict[str, set[Verdict]]
    about_frames: dict[tuple[Check, Frame], set[RuleResult | None]]


@pytest.fixture(scope="module")
def all_results(script: Script) -> AllResults:
    """Apply every rule to all cases."""
    rule_verdicts = AllResults(defaultdict(set), defaultdict(set))
    rules: dict[object, list[Rule]] = {}
    for session in SESSIONS:
        judge = Judge()
        items = chain(*(judge.feed(event) for event in script(session)), judge.close())
        for item in (item for item in items if not isinstance(item, Finding)):
            kind = kind_of(item)
            if kind not in rules:
                rules[kind] = [rule for rule in RULES if rule.applies_to(item)]
            for rule in rules[kind]:
                result = rule.check(item, next(iter(judge.robots.values())))
                if result:
                    rule_verdicts.verdicts[label(rule)].add(result.verdict)
                if isinstance(item, FrameSeen):
                    rule_verdicts.about_frames[rule.check, item.frame].add(result)
    return rule_verdicts


@pytest.fixture(scope="module")
def rule_verdicts(all_results: AllResults) -> dict[str, set[Verdict]]:
    """The verdicts that each rule gives in all cases."""
    return all_results.verdicts


def test_rules_about_a_frame_see_the_frame_alone(all_results: AllResults) -> None:
    """Equal frames give equal results at every place and time, and in every robot state."""
    assert len(all_results.about_frames) > 5_000
    for (check, frame), results in all_results.about_frames.items():
        seen = FrameSeen(frame, WireRange("", A2C, 0, 0, 0), 0, parse_frame(frame))
        assert results == {check(seen, RobotState())}


# One test for all rules, requirements or sessions: pytest would need longer than these checks for
# two thousand tests.


def test_every_rule_gives_a_verdict(rule_verdicts: dict[str, set[Verdict]]) -> None:
    """Each rule gives a verdict in at least one case in CASES of one of the rules' tests."""
    assert [label(rule) for rule in RULES if not rule_verdicts[label(rule)]] == []


def test_every_requirement_passes_and_fails(rule_verdicts: dict[str, set[Verdict]]) -> None:
    """Each requirement has a case that passes and one that does not, or is in PASSES_ONLY."""
    broken = {"fail", "tolerated", "inconclusive"}
    for requirement in {rule.requirement for rule in RULES}:
        assert requirement in REQUIREMENTS
        verdicts = set().union(
            *(rule_verdicts[label(r)] for r in RULES if r.requirement == requirement)
        )
        named = {expected.split()[0] for name, expected, _ in CASES if name == requirement}
        if requirement in NEVER_PASSES:
            assert Verdict.PASS not in verdicts, requirement
            assert named & broken, requirement
        elif requirement in PASSES_ONLY:
            assert verdicts == {Verdict.PASS}, requirement
            assert "pass" in named, requirement
        else:
            assert verdicts > {Verdict.PASS}, requirement
            assert "pass" in named, requirement
            assert named & broken, requirement


def test_tolerations_name_a_reading() -> None:
    """A toleration names a reading and one of its options, or the register entry."""
    for requirement, expected, _ in CASES:
        verdict, _, reading = expected.partition(" ")
        if verdict != "tolerated":
            continue
        key, _, option = reading.partition("=")
        assert option, expected
        entry = key.startswith("A-") or key == requirement  # an observation names its requirement
        known = entry or READINGS[key].unit or option in {o.name for o in READINGS[key].options}
        assert known, expected


def test_single_bytes_give_the_same_result(script: Script, judged: Judged, recut: Recut) -> None:
    """Single bytes give the same events and findings, except for their times."""
    for session in WITHOUT_GAPS:
        events = script(session)
        assert judged(recut(events, lambda: 1)).printed == judged(events).printed, session


@given(st.sampled_from(WITHOUT_GAPS), st.data())
def test_any_pieces_give_the_same_result(
    script: Script, judged: Judged, recut: Recut, session: str, data: st.DataObject
) -> None:
    """Pieces of any size give the same events and findings."""
    events = script(session)
    pieces = recut(events, lambda: data.draw(st.integers(1, 9)))
    assert judged(pieces).printed == judged(events).printed


# A gap never causes a failure.

SHIFT = r"""
    login
    > get_status
    < get_status 00
    > list_programs
    < list_programs 1|a.rob
    < list_programs 0|b.rob
    > upload_name \xaa\x09\x00\xcc
    < upload_name 1
    > chunk 0/500
    < upload_chunk 1
    > chunk 200/500
    < upload_chunk 1
    > chunk 400/500
    < upload_chunk 1
    > upload_name \xaa\x09\x00\xcc
    < upload_name 0
    2> login password
    2< login 1
    > run_program a.rob
    < run_program 1
    > get_status
    < get_status 01
    2> get_status
    2< get_status 01
    > reset
    < reset 0|01
    <90 run_program 11
    > get_status
    < get_status 00
    > jog 1
    < jog 1
    > get_status
    2> emergency_stop
    2< emergency_stop 1
    < get_status 04
    2<90 emergency_stop 11
    <90 jog 11
    > reset
    < reset 1
    > get_status
    < get_status 03
    +3
    <90 reset 11
    > download_name \xaa\x09\x00\xcc
    < download_name 1
    < chunk 0/500
    > download_chunk 1
    < chunk 200/500
    > download_chunk 1
    < chunk 400/500
    > download_chunk 1
    2> delete_program \xaa\x09\x00\xcc
    2< delete_program 1
    > upload_name \xaa\x09\x00\xcc
    < upload_name 1
    > chunk 0/9 other
    < upload_chunk 1
    2> download_name \xaa\x09\x00\xcc
    2< download_name 1
    2< chunk 0/9 other
    2> download_chunk 1
    2> set_password password|new
    2< set_password 1
    2> close
    > close
    3> login password
    3< login 0
    3> login new
    3< login 1
    +7
    3> get_status
    3< get_status 00
    3> simulate_program a.rob
    3< simulate_program 1
    3> get_status
    3< get_status 02
    3<90 simulate_program 00|05
    3> shutdown
    3< shutdown 1
    3< half-close
    3> close
"""


def tear(
    events: Iterable[WireEvent],
    truncated: tuple[str, Direction],
    begin: int,
    end: int,
    *,
    late: bool,
) -> Iterator[WireEvent]:
    """Yield the events without the bytes from `begin` to `end` of one stream.

    One gap at the beginning replaces all of them. If `late`, a gap replaces each event.
    """
    printed = False
    for event in events:
        at, size = event.offset_bytes, len(event.data)
        first, last = max(at, begin), min(at + size, end)
        if (event.connection, event.direction) != truncated or first >= last:
            yield event
            continue
        if at < first:
            yield replace(event, data=event.data[: first - at])
        if late or not printed:
            length = (last if late else end) - first
            yield replace(event, kind=Kind.GAP, data=b"", offset_bytes=first, length_bytes=length)
            printed = True
        if last < at + size:
            yield replace(event, data=event.data[last - at :], offset_bytes=last)


Draw = Callable[[st.SearchStrategy[Any]], Any]


def with_gaps(draw: Draw, events: list[WireEvent]) -> list[WireEvent]:
    """Return the events without some of their bytes."""
    for _ in range(draw(st.integers(1, 3))):
        streams = sorted({(e.connection, e.direction.value) for e in events if e.data})
        if not streams:
            break
        connection, direction = draw(st.sampled_from(streams))
        stream = (connection, Direction(direction))
        offsets = [
            offset
            for e in events
            if e.data and (e.connection, e.direction) == stream
            for offset in (e.offset_bytes, e.offset_bytes + len(e.data))
        ]
        begin = draw(st.integers(min(offsets), max(offsets) - 1))
        end = draw(st.integers(begin + 1, max(offsets)))
        events = list(tear(events, stream, begin, end, late=draw(st.booleans())))
    return events


def seen_partially(draw: Draw, events: list[WireEvent]) -> list[WireEvent]:
    """Return the events as seen by an observer that starts late and stops early."""
    first = draw(st.integers(0, len(events) - 1))
    last = draw(st.integers(first + 1, len(events)))
    seen: set[str] = set()
    late: list[WireEvent] = []
    for index, event in enumerate(events[first:last]):
        if event.connection not in seen and event.kind is not Kind.OPENED and first:
            gap = replace(event, kind=Kind.GAP, data=b"", length_bytes=-1)
            late += [replace(gap, direction=direction) for direction in Direction]
        seen.add(event.connection)
        cut = draw(st.integers(0, len(event.data))) if not index else 0
        late.append(replace(event, data=event.data[cut:]))
    return late


@pytest.fixture(scope="module")
def conforming(script: Script, judged: Judged) -> list[list[WireEvent]]:
    """Sessions without failures, unchanged."""
    sessions = [script(session) for session in SESSIONS]
    return [events for events in sessions if not judged(events).failed]


def test_the_whole_session_conforms(script: Script, judged: Judged) -> None:
    """The session that is damaged below is conforming when it is complete, and tests many
    requirements."""
    record = judged(script(SHIFT))
    assert record.judge.conclusion is Conclusion.CONFORMANT
    assert {f.requirement for f in record.findings} <= {"3/18"}
    assert len(record.judge.tallies) > 60


TWO = """
    1> open {one}
    1> login secret
    1< login 1
    2> open {two}
    2> login other
    2< login 1
    1> run_program a
    1< run_program 1
    +5
    2> shutdown
    2< shutdown 1
    +5
    1<90 run_program 11
"""


@pytest.mark.parametrize(
    ("one", "two", "failed"),
    [
        ("10.0.0.9:40000 → 10.0.0.1:8877", "10.0.0.9:40001 → 10.0.0.2:8877", set()),
        ("10.0.0.9:40000 > 10.0.0.1:8877", "10.0.0.9:40001 > 10.0.0.2:8877", set()),
        ("10.0.0.8:40000 → 10.0.0.1:8877", "10.0.0.9:40001 → 10.0.0.1:8877", {"4.1/3", "4.35/4"}),
        ("a → 10.0.0.1:8877, since 2026-01-01", "b → 10.0.0.1:8877", {"4.1/3", "4.35/4"}),
    ],
)
def test_two_controllers_are_separated(
    judged: Judged, one: str, two: str, failed: set[str]
) -> None:
    """Events of one robot do not count for another robot of the same recording."""
    assert judged(TWO.format(one=one, two=two)).failed == failed


def test_number_of_controllers_is_limited(judged: Judged) -> None:
    """A recording of a thousand robots keeps a limited number of them in memory."""
    lines = (f"{n}> open 10.0.0.9:4 → 10.0.{n // 256}.{n % 256}:8877" for n in range(1000))
    assert len(judged("\n".join(lines)).judge.robots) < 100


def test_closed_connections_are_forgotten(judged: Judged) -> None:
    """Connections that were replaced or have ended are not kept in memory."""
    lines = (f"{n}> open 10.0.0.9:{n} → 10.0.0.1:8877" for n in range(5000))
    assert not judged("\n".join(lines)).robot.connected
    assert not judged("login\n> close\n2> open\n2< rst\n2> open").robot.connected


@settings(max_examples=80)
@given(st.data())
def test_gaps_cause_no_failures(script: Script, judged: Judged, data: st.DataObject) -> None:
    """Wherever bytes are missing from a conforming session, nothing fails."""
    record = judged(with_gaps(data.draw, script(SHIFT)))
    assert not record.failed


@settings(max_examples=60)
@given(st.data())
def test_partial_observation_causes_no_failures(
    script: Script, judged: Judged, data: st.DataObject
) -> None:
    """Nothing fails if the observer starts in the middle and stops before the end."""
    events = seen_partially(data.draw, script(SHIFT))
    assert not judged(events).failed
    assert not judged(with_gaps(data.draw, events)).failed


@settings(max_examples=60)
@given(st.data())
def test_gaps_in_small_sessions_cause_no_failures(
    conforming: list[list[WireEvent]], judged: Judged, data: st.DataObject
) -> None:
    """The same for all small sessions of the rules."""
    events = data.draw(st.sampled_from(conforming))
    assert not judged(with_gaps(data.draw, events)).failed
    assert not judged(seen_partially(data.draw, events)).failed
