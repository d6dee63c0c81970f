"""Judge: turns wire events into traffic events, findings, the dialect and a conclusion.

The same judge is used for live recordings, field captures and every case of the suite. It follows
all connections of a controller with one robot state, applies the rules, and counts the results.
`rules` defines what conforms. The judge ensures that a capture gap never causes a failure.
"""

import re
from collections import Counter, OrderedDict, defaultdict
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from itertools import groupby
from typing import Final, NamedTuple

from scaraspec.judge.dialect_detector import DialectDetector
from scaraspec.judge.program_file_readings import observed_file_readings
from scaraspec.judge.requirements import REQUIREMENTS, Strength
from scaraspec.judge.rules import RULES
from scaraspec.judge.rules.rule import (
    PASSED,
    Check,
    RuleResult,
    is_certain,
    kind_of,
    places_of,
)
from scaraspec.judge.scope import EVERYTHING, Scope, responsible_side
from scaraspec.judge.verdicts import Cause, Conclusion, Finding, Side, Verdict, conclude, worst
from scaraspec.protocol.direction import A2C, C2A
from scaraspec.protocol.readings import DEFAULT, Dialect
from scaraspec.traffic.dialogue import Dialogue
from scaraspec.traffic.events import Exchange, FrameSeen, TrafficEvent, Transfer
from scaraspec.traffic.robot_state import LONGEST_PAUSE_NS, RESULT_LAG_NS, RobotState
from scaraspec.traffic.wire import Kind, WireEvent, WireRange
from scaraspec.user_message import UserMessage

_MAX_FINDINGS: Final = 50
"""Kept findings per requirement and verdict; further ones are only counted."""

_MAX_CONNECTIONS: Final = 4096
"""Maximum number of connections; above it, the one that was silent longest is dropped."""

_MAX_CONTROLLERS: Final = 64
"""Maximum number of controllers; above it, the state of the first one is dropped."""

_CONTROLLER: Final = re.compile(r"[>→] ([^\s,)]+)")
"""Matches the second address in the note of a connection's first event."""

_UNCERTAIN: Final = {
    Side.RECORDING: "a gap in the recording or a fault injected on purpose may be why",
    Side.NETWORK: "a fault that was injected on purpose may be why",
    None: "bytes that belong to no frame may be why",
}
_AMBIGUOUS: Final = "its reply may answer another request, which timed out"
_TWO_COPIES: Final = "two different copies of its bytes were captured"
_GAP_BESIDE: Final = "a request in a gap of another connection may be why"
_ASSUMES_GAP: Final = ("in a gap of the recording", "in a gap")
_IN_OTHER_BYTES: Final = "not decided: the receiver may have read it as part of other bytes"
_SIDES: Final = {A2C: Side.CLIENT, C2A: Side.CONTROLLER, None: None}


_KNOWN: Final = 1024
"""Distinct frames and exchanges whose results are kept; polling repeats the same ones."""
_NOWHERE: Final = WireRange("", A2C, 0, 0, 0)
_UNKNOWN_STATE: Final = RobotState()


class _Results(NamedTuple):
    """What the rules say about one traffic event.

    Attributes:
        passed: The requirements in scope that it meets.
        others: The results other than passes, each with the requirements and those in scope.
    """

    passed: list[str]
    others: list[tuple[RuleResult, tuple[str, ...], tuple[str, ...]]]


_ScopedChecks = list[tuple[Check, tuple[str, ...], tuple[str, ...]]]
"""Check functions, each with the requirements that it decides, and those of them in scope."""


class _Checks(NamedTuple):
    """The checks of one kind of traffic event.

    Attributes:
        by_bytes: The checks of rules that depend on the bytes of the event alone.
        others: The other checks.
    """

    by_bytes: _ScopedChecks
    others: _ScopedChecks


@dataclass(slots=True)
class Tally:
    """The results for one requirement."""

    passes: int = 0
    others: Counter[Verdict] = field(default_factory=Counter)
    findings: list[Finding] = field(default_factory=list)

    @property
    def counts(self) -> Counter[Verdict]:
        """How often each verdict was given."""
        return Counter({Verdict.PASS: self.passes} if self.passes else {}) + self.others

    @property
    def verdict(self) -> Verdict:
        """The gravest verdict; verdicts only rise."""
        return worst(+self.counts)


class Judge:
    """Judges a recording; the connections of a controller are judged together.

    Args:
        dialect: The reply and transfer timeouts that the SUT claims.
        needs_login: False for a serial link, which needs no login (L83).
        scope: Which findings count. The others are yielded, too, but not tallied.
        time_scale: How many seconds of the controller pass in one second of the traffic.
    """

    def __init__(
        self,
        dialect: Dialect = DEFAULT,
        *,
        needs_login: bool = True,
        scope: Scope = EVERYTHING,
        time_scale: float = 1.0,
    ) -> None:
        self.scope = scope
        self.tallies: dict[str, Tally] = defaultdict(Tally)
        """The results in scope by requirement id; only requirements with a result."""
        self.other_side = 0
        """The number of findings, other than passes, about the side that is not the subject."""
        self.dialect_seen = DialectDetector()
        self.robots: OrderedDict[str, RobotState] = OrderedDict()
        """The state of each controller, by address; without a known address they share one."""
        self._dialect = dialect
        self._needs_login = needs_login
        self._longest_pause_ns = round(LONGEST_PAUSE_NS / time_scale)
        self._dialogues: dict[str, Dialogue] = {}
        self._rules = _rules_in(scope)
        self._is_partial = scope.selection != EVERYTHING.selection

    def feed(self, event: WireEvent) -> Iterator[TrafficEvent | Finding]:
        """Process the next event; yield each traffic event, followed by its findings."""
        dialogue = self._dialogue(event)
        if event.kind is Kind.GAP and event.length_bytes:
            self._discredit_before(event, dialogue.hidden_since_ns(event))
        for traffic_event in dialogue.feed(event):
            yield traffic_event
            yield from self.judge(traffic_event, dialogue.robot)
        if event.kind in (Kind.CLOSED, Kind.RESET):
            del self._dialogues[event.connection]
        while len(self._dialogues) > _MAX_CONNECTIONS:
            yield from self._end(next(iter(self._dialogues)))

    def transferring(self, connection: str) -> bool:
        """Whether a file transfer may be active on this connection, for one side at least."""
        return connection in self._dialogues and self._dialogues[connection].transferring

    def results_are_late(self) -> None:
        """Note that final results were measured to come after the status 00 (A-4-9)."""
        for robot in self.robots.values():
            robot.result_lag_ns = RESULT_LAG_NS

    def status_is_current(self) -> None:
        """Note that a status is never old, so that it is not tolerated (A-4.8-3)."""
        for robot in self.robots.values():
            robot.status_lag_ns = 0

    def _dialogue(self, event: WireEvent) -> Dialogue:
        """Return the dialogue of the connection, moved to the end."""
        connection = event.connection
        dialogue = self._dialogues.pop(connection, None) or Dialogue(
            connection, self._robot(event), self._dialect, needs_login=self._needs_login
        )
        self._dialogues[connection] = dialogue
        return dialogue

    def _robot(self, first: WireEvent) -> RobotState:
        """Return the state of the connection's controller, which its first note names."""
        controller = _CONTROLLER.search(first.note)
        fresh = RobotState(self._longest_pause_ns)
        robot = self.robots.setdefault(controller[1] if controller else "", fresh)
        if len(self.robots) > _MAX_CONTROLLERS:
            self.robots.popitem(last=False)
        return robot

    def close(self) -> Iterator[TrafficEvent | Finding]:
        """End the recording; yield the pending traffic events and their findings."""
        while self._dialogues:
            yield from self._end(next(iter(self._dialogues)))

    def _end(self, connection: str) -> Iterator[TrafficEvent | Finding]:
        dialogue = self._dialogues.pop(connection)
        for traffic_event in dialogue.close():
            yield traffic_event
            yield from self.judge(traffic_event, dialogue.robot)

    def judge(self, traffic_event: TrafficEvent, robot: RobotState) -> Sequence[Finding]:
        """Apply every rule for this traffic event; return the findings other than passes."""
        self.dialect_seen.add(traffic_event)
        if self._is_partial and not self.scope.selection.includes(traffic_event):
            robot.remember(traffic_event)
            return ()
        if isinstance(traffic_event, Transfer):
            self.dialect_seen.counts.update(observed_file_readings(traffic_event))
        results = self._rules.apply(traffic_event, robot)
        tallies = self.tallies
        for requirement in results.passed:
            tallies[requirement].passes += 1
        findings = self._findings(results, traffic_event, robot) if results.others else ()
        robot.remember(traffic_event)
        return findings

    def _findings(
        self, results: _Results, traffic_event: TrafficEvent, robot: RobotState
    ) -> list[Finding]:
        """Return the findings for results other than passes, and count them."""
        findings = []
        unreliable = _unreliable(traffic_event, robot)
        for judged, requirements, in_scope in results.others:
            if unreliable and judged.verdict is Verdict.TOLERATED:
                continue  # it may be another exchange than it seems
            for requirement in requirements:
                finding = _finding(requirement, judged, traffic_event, unreliable)
                if requirement in in_scope:
                    self._tally(finding)
                elif not self.scope.concerns(requirement, traffic_event):
                    self.other_side += 1
                findings.append(finding)
        return findings

    def discredit(self, unreliable: Sequence[WireRange]) -> None:
        """Make the failures that rest on unreliable bytes inconclusive.

        Args:
            unreliable: Bytes of which a capture has two different copies.
        """
        self._discredit(_TWO_COPIES, lambda finding: _rests_on(finding, unreliable))

    def _discredit_before(self, gap: WireEvent, since_ns: int) -> None:
        """Make the failures inconclusive that a request hidden by a gap may explain.

        The reply to the request shows the gap. Other connections may have shown its effect before.

        Args:
            gap: The gap.
            since_ns: The request was sent after this time.
        """

        def may_depend(finding: Finding) -> bool:
            *earlier, last = finding.evidence or (_NOWHERE,)
            beside = last.connection != gap.connection
            return bool(earlier) and beside and last.time_ns > since_ns

        self._discredit(_GAP_BESIDE, may_depend)

    def _discredit(self, reason: str, applies: Callable[[Finding], bool]) -> None:
        for tally in self.tallies.values():
            for at, finding in enumerate(tally.findings if tally.others[Verdict.FAIL] else ()):
                if finding.verdict is Verdict.FAIL and applies(finding):
                    tally.findings[at] = replace(
                        finding,
                        verdict=Verdict.INCONCLUSIVE,
                        cause=Cause.SET_UP,
                        side=Side.RECORDING,
                        message=_with_reason(finding.message, reason),
                    )
                    tally.others[Verdict.FAIL] -= 1
                    tally.others[Verdict.INCONCLUSIVE] += 1

    def drop_unseen(self, connections: Collection[str]) -> None:
        """Drop the findings that bytes may be missing on these connections.

        Args:
            connections: Connections of which a capture has one direction only.
        """
        for requirement, tally in list(self.tallies.items()):
            tally.findings = [
                finding
                for finding in tally.findings
                if finding.side is not Side.RECORDING
                or not finding.evidence
                or finding.evidence[0].connection not in connections
            ]
            left = Counter(finding.verdict for finding in tally.findings)
            if not left[Verdict.INCONCLUSIVE]:
                tally.others[Verdict.INCONCLUSIVE] = 0
            if not +tally.counts:
                del self.tallies[requirement]

    def _tally(self, finding: Finding) -> None:
        tally = self.tallies[finding.requirement]
        tally.others[finding.verdict] += 1
        if tally.others[finding.verdict] <= _MAX_FINDINGS:
            tally.findings.append(finding)

    @property
    def conclusion(self) -> Conclusion:
        """The conclusion of the recording."""
        return conclude(Counter(tally.verdict for tally in self.tallies.values()))


class _RulesInScope:
    """Applies the rules, and keeps apart the requirements that a scope includes."""

    def __init__(self, scope: Scope) -> None:
        self._scope = scope
        self._checks: dict[tuple[object, ...], _Checks] = {}
        self._by_bytes: dict[tuple[object, ...], _Results] = {}

    def apply(self, traffic_event: TrafficEvent, robot: RobotState) -> _Results:
        """Apply every rule for this traffic event."""
        if isinstance(traffic_event, FrameSeen):
            return self._of_bytes(traffic_event, traffic_event.frame)
        checks = self._checks_for(traffic_event)
        results = _Results([], [])
        if isinstance(traffic_event, Exchange) and traffic_event.plain:
            known = self._of_bytes(traffic_event, traffic_event.bytes_key)
            results.passed.extend(known.passed)
            results.others.extend(known.others)
        else:
            _apply(checks.by_bytes, traffic_event, robot, results)
        _apply(checks.others, traffic_event, robot, results)
        return results

    def _of_bytes(self, traffic_event: FrameSeen | Exchange, key: tuple[object, ...]) -> _Results:
        """Apply the rules that depend on the bytes of an event alone, once for equal bytes."""
        results = self._by_bytes.get(key)
        if results is None:
            results = _Results([], [])
            checks = self._checks_for(traffic_event)
            _apply(checks.by_bytes, traffic_event, _UNKNOWN_STATE, results)
            if len(self._by_bytes) >= _KNOWN:
                self._by_bytes.clear()
            if not any(judged.places for judged, *_ in results.others):
                self._by_bytes[key] = results
        return results

    def _checks_for(self, traffic_event: TrafficEvent) -> _Checks:
        """Return the checks for a traffic event, each once, with the requirements they decide."""
        kind = kind_of(traffic_event)
        checks = self._checks.get(kind)
        if checks is None:
            checks = self._checks[kind] = _Checks([], [])
            rules = [rule for rule in RULES if rule.applies_to(traffic_event)]
            for check, group in groupby(rules, key=lambda rule: rule.check):
                same = [*group]
                ids = tuple(rule.requirement for rule in same)
                in_scope = tuple(i for i in ids if self._scope.includes(i, traffic_event))
                listed = checks.by_bytes if same[0].by_bytes else checks.others
                listed.append((check, ids, in_scope))
        return checks


_rules_in = cache(_RulesInScope)
"""Every judge with the same scope has the same rules."""


def _apply(
    checks: _ScopedChecks,
    traffic_event: TrafficEvent,
    robot: RobotState,
    results: _Results,
) -> None:
    """Add the results of checks."""
    for check, requirements, in_scope in checks:
        judged = check(traffic_event, robot)
        if judged is PASSED:
            results.passed.extend(in_scope)
        elif judged is not None:
            results.others.append((judged, requirements, in_scope))


def _rests_on(finding: Finding, ranges: Sequence[WireRange]) -> bool:
    return any(
        place[:2] == other[:2]
        and place.offset_bytes < other.offset_bytes + other.length_bytes
        and other.offset_bytes < place.offset_bytes + place.length_bytes
        for place in finding.evidence
        for other in ranges
    )


def _unreliable(traffic_event: TrafficEvent, robot: RobotState) -> Side | None:
    """Return what makes an event uncertain; None if nothing but bytes that belong to no frame."""
    if is_certain(traffic_event) or not (robot.bytes_missing or robot.fault_injected):
        return None
    return Side.RECORDING if robot.bytes_missing else Side.NETWORK


def _with_reason(message: str, reason: str) -> str:
    """Return the message of a failure that may have another reason."""
    return UserMessage.joined(message, "; {reason}", reason=reason)


def _finding(
    requirement: str, judged: RuleResult, traffic_event: TrafficEvent, unreliable: Side | None
) -> Finding:
    """Convert a rule's result to a finding.

    An INFO requirement never fails. An uncertain event never causes a failure.
    """
    side = _SIDES[responsible_side(requirement, traffic_event)]
    verdict, message, reading = judged.verdict, judged.message, judged.reading
    if verdict is Verdict.FAIL and not is_certain(traffic_event):
        ambiguous = isinstance(traffic_event, Exchange) and traffic_event.ambiguous
        reason = _AMBIGUOUS if ambiguous else _UNCERTAIN[unreliable]
        verdict, message = Verdict.INCONCLUSIVE, _with_reason(message, reason)
    elif message.endswith(_ASSUMES_GAP) and not unreliable and not is_certain(traffic_event):
        message = _IN_OTHER_BYTES
    elif verdict is Verdict.FAIL and REQUIREMENTS[requirement].strength is Strength.INFO:
        verdict, reading = Verdict.TOLERATED, (requirement, "observed otherwise")
    return Finding(
        requirement,
        verdict,
        Cause.SET_UP if verdict is Verdict.INCONCLUSIVE else Cause.SUBJECT,
        message,
        judged.expected,
        judged.observed,
        judged.places or places_of(traffic_event),
        reading,
        unreliable if unreliable and verdict is Verdict.INCONCLUSIVE else side,
    )
