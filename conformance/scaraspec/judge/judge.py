"""Judge: wire events in; happenings, findings, the dialect and a conclusion out.

One judge for live recordings, captures from the field and every case of the suite. It joins the
dialogues of all connections of a controller over one scene, asks the rules, and keeps count. What
is right is in `rules`. The judge ensures that a gap never causes a failure.
"""

import re
from collections import Counter, OrderedDict, defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import groupby
from typing import Final

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
from scaraspec.judge.verdicts import Cause, Conclusion, Finding, Verdict, conclude, worst
from scaraspec.protocol.readings import DEFAULT, Dialect
from scaraspec.traffic.dialogue import Dialogue
from scaraspec.traffic.events import TrafficEvent, Transfer
from scaraspec.traffic.robot_state import RobotState
from scaraspec.traffic.wire import Kind, WireEvent

_KEPT_FINDINGS: Final = 50
"""Findings kept of one requirement and verdict; beyond that they are counted."""

_MOST_CONNECTIONS: Final = 4096
"""Connections followed at once; beyond that the one that was silent for longest is given up."""

_MOST_CONTROLLERS: Final = 64
"""Controllers told apart at once; beyond that the one that was met first is forgotten."""

_CONTROLLER: Final = re.compile(r"[>→] ([^\s,)]+)")
"""The second of the addresses in the note of a beginning."""

_DOUBT: Final = "a gap in the recording or a fault injected on purpose may be why"


@dataclass(slots=True)
class Tally:
    """What was found of one requirement."""

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
        return worst(self.counts)


class Judge:
    """Judges a recording, all connections of one controller together.

    Args:
        dialect: What the subject claims about reply and transfer time-outs.
        needs_login: False for a serial link, which serves without a login (L83).
    """

    def __init__(self, dialect: Dialect = DEFAULT, *, needs_login: bool = True) -> None:
        self.tallies: dict[str, Tally] = defaultdict(Tally)
        """Requirements on which something was found, by id."""
        self.dialect_seen = DialectDetector()
        self.robots: OrderedDict[str, RobotState] = OrderedDict()
        """What is known of each controller, by its address; those of no known address are one."""
        self._dialect = dialect
        self._needs_login = needs_login
        self._dialogues: dict[str, Dialogue] = {}

    def feed(self, event: WireEvent) -> Iterator[TrafficEvent | Finding]:
        """Take the next event; give what happened, each followed by what is wrong with it."""
        dialogue = self._dialogue(event)
        for traffic_event in dialogue.feed(event):
            yield traffic_event
            yield from self.judge(traffic_event, dialogue.robot)
        if event.kind in (Kind.CLOSED, Kind.RESET):
            del self._dialogues[event.connection]
        while len(self._dialogues) > _MOST_CONNECTIONS:
            yield from self._end(next(iter(self._dialogues)))

    def transferring(self, connection: str) -> bool:
        """Whether a file may be under way on this connection, for one of its ends at least."""
        return connection in self._dialogues and self._dialogues[connection].transferring

    def _dialogue(self, event: WireEvent) -> Dialogue:
        """The connection's dialogue, moved to the end."""
        connection = event.connection
        dialogue = self._dialogues.pop(connection, None) or Dialogue(
            connection, self._robot(event), self._dialect, needs_login=self._needs_login
        )
        self._dialogues[connection] = dialogue
        return dialogue

    def _robot(self, first: WireEvent) -> RobotState:
        """The scene of the controller that a connection goes to, by the note it begins with."""
        controller = _CONTROLLER.search(first.note)
        robot = self.robots.setdefault(controller[1] if controller else "", RobotState())
        if len(self.robots) > _MOST_CONTROLLERS:
            self.robots.popitem(last=False)
        return robot

    def close(self) -> Iterator[TrafficEvent | Finding]:
        """The recording has ended."""
        while self._dialogues:
            yield from self._end(next(iter(self._dialogues)))

    def _end(self, connection: str) -> Iterator[TrafficEvent | Finding]:
        dialogue = self._dialogues.pop(connection)
        for traffic_event in dialogue.close():
            yield traffic_event
            yield from self.judge(traffic_event, dialogue.robot)

    def judge(self, traffic_event: TrafficEvent, robot: RobotState) -> Iterator[Finding]:
        """Ask every rule that looks at this happening; give the findings that are no pass."""
        self.dialect_seen.add(traffic_event)
        if isinstance(traffic_event, Transfer):
            self.dialect_seen.counts.update(observed_file_readings(traffic_event))
        tallies = self.tallies
        for check, requirements in _checks_for(traffic_event):
            judged = check(traffic_event, robot)
            if judged is None:
                continue
            if judged is PASSED:
                for requirement in requirements:
                    tallies[requirement].passes += 1
                continue
            for requirement in requirements:
                finding = _finding(requirement, judged, traffic_event)
                tally = tallies[requirement]
                tally.others[finding.verdict] += 1
                if tally.others[finding.verdict] <= _KEPT_FINDINGS:
                    tally.findings.append(finding)
                yield finding
        robot.remember(traffic_event)

    @property
    def conclusion(self) -> Conclusion:
        """What the recording amounts to."""
        return conclude(Counter(tally.verdict for tally in self.tallies.values()))


_Checks = tuple[tuple[Check, tuple[str, ...]], ...]

_CHECKS: Final[dict[tuple[object, ...], _Checks]] = {}
"""What was found for each kind of happening: the rules are the same for every judge."""


def _checks_for(traffic_event: TrafficEvent) -> _Checks:
    """The checks that look at such a happening, each once, with what they decide."""
    kind = kind_of(traffic_event)
    checks = _CHECKS.get(kind)
    if checks is None:
        rules = [rule for rule in RULES if rule.applies_to(traffic_event)]
        grouped = groupby(rules, key=lambda rule: rule.check)
        checks = tuple((c, tuple(rule.requirement for rule in g)) for c, g in grouped)
        _CHECKS[kind] = checks
    return checks


def _finding(requirement: str, judged: RuleResult, traffic_event: TrafficEvent) -> Finding:
    """The finding that a rule's word amounts to.

    An INFO requirement never fails, nor does what a gap or an injected fault may have affected.
    """
    verdict, message, reading = judged.verdict, judged.message, judged.reading
    if verdict is Verdict.FAIL and not is_certain(traffic_event):
        verdict, message = Verdict.INCONCLUSIVE, f"{message}; {_DOUBT}"
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
    )
