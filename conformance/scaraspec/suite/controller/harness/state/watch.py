"""Watch: after a failure, whether settings change while the suite sends nothing but queries.

A fault of the controller must not be taken for another client. A change counts only if the setting
does not vary all the time. A change to a value that no request of the suite explains is proof. A
value that the suite has set, or that was there at the start, may also come back because the
controller forgets what was set. It forgets after a fixed time, and a client comes at any time:
proof is a change that comes sooner than the time for which a value has stayed.
"""

import itertools
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

from scaraspec.protocol.commands import BY_OPCODE
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.hazard import Hazard
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.setting_values import (
    CLOCK,
    DEFAULT_PROGRAM,
    GRIPPER_CENTRE,
    INITIAL_POSITION,
    PROGRAMS,
    QUERIES,
    SETTERS,
    reported,
)
from scaraspec.suite.controller.harness.state.defaults import default_program_preserved
from scaraspec.suite.controller.harness.state.preserve import settings_preserved
from scaraspec.suite.engine.connection import ReceivedFrame
from scaraspec.suite.engine.expectations import CaseFailed, CaseInconclusive, NoReply
from scaraspec.suite.program_files.listed import program_names, store_program

_SET_AGAIN: Final = (CLOCK, GRIPPER_CENTRE, INITIAL_POSITION)
"""What is set to another value in turn, so that a client shows that sets the old one."""
_NOON: Final = b"20240615120000"
"""The clock is set to a time after which nothing but seconds and minutes rolls over."""

_TURNS: Final = 10
"""In how many turns all is looked at, or one setting is set again."""
_PAUSES: Final = 4
"""How many pauses there are in a turn at first."""
_SHORTER: Final = 0.5
_LONGER: Final = 1.5
_SHORTEST_S: Final = 0.002
"""The pause after a setting was set again gets shorter after a change and else longer: so a client
that comes every so often leaves alone one value and not another."""
_LONGER_ROUNDS: Final = 3
_TWICE: Final = 2
_OFTEN: Final = 12
"""How often a setting must give a value in a row: before it has changed, and after that."""
_LOOSE: Final = 2.0
"""A clock that stands still, or runs three times as fast, is a fault and no client."""
_NEVER_S: Final = float("inf")
_NS: Final = 1e9


def watch(subject: ControllerUnderTest, for_s: float) -> None:
    """Read again what the failed case depended on, and watch what has deviated.

    What is found is in `subject.others` afterwards.

    Args:
        subject: The controller, at rest.
        for_s: How long to watch.
    """
    others = subject.others
    with suppress(CaseFailed, CaseInconclusive):
        line = subject.open()
        read = {name for name in others.touched if _read(subject, line, name) is not None}
        if read & others.deviating.keys() and not others.proved:
            names = [name for name in QUERIES if _read(subject, line, name) is not None]
            with _set_again(subject, line, others.deviating) as requests:
                _Watch(subject, line, names, requests).run(for_s)
        subject.delete_own_files(line)
    subject.close_lines()


@contextmanager
def _set_again(
    subject: ControllerUnderTest, line: OutgoingConnection, names: Collection[str]
) -> Iterator[dict[str, bytes]]:
    """What to set in turn, by name; afterwards all is set to what it is now.

    So the judge compares with this, too, and no longer with what was set before.
    """
    settings = subject.others.settings
    harmless = [n for n in names if n in _SET_AGAIN and Hazard.STATE in subject.allowed]
    requests = {name: settings[name].request for name in harmless if settings[name].request}
    if CLOCK in requests:
        requests[CLOCK] = _NOON
    with settings_preserved(subject, line, *harmless), default_program_preserved(subject, line):
        if DEFAULT_PROGRAM in names and settings[DEFAULT_PROGRAM].request:
            with suppress(CaseFailed, CaseInconclusive):
                requests[DEFAULT_PROGRAM] = store_program(subject, line)
        yield requests


class _Reading(NamedTuple):
    """A value, and when it was asked for and answered, in seconds."""

    value: Any
    asked_s: float
    answered_s: float


@dataclass
class _Lasting:
    """How long the values of one setting have lasted after it was set again, in seconds.

    Attributes:
        pause_s: How long to wait in the next round.
        stayed_s: The longest time for which a value has stayed.
        changed_s: The shortest time within which one has changed.
        change: What it changed from and to.
    """

    pause_s: float
    stayed_s: float = 0.0
    changed_s: float = _NEVER_S
    change: tuple[Any, Any] = (None, None)


class _Watch:
    """One time of watching.

    Args:
        subject: The controller.
        line: A connection.
        names: What to watch.
        requests: What to set in turn, by name.
    """

    def __init__(
        self,
        subject: ControllerUnderTest,
        line: OutgoingConnection,
        names: list[str],
        requests: Mapping[str, bytes],
    ) -> None:
        self._subject, self._line = subject, line
        self._names, self._requests = names, requests

    def run(self, for_s: float) -> None:
        """Watch until another client is proved, for about so many seconds at most.

        Raises:
            CaseFailed: The controller does not answer.
        """
        subject, turn_s = self._subject, for_s / _TURNS
        until_ns = subject.now_ns + round(for_s * _NS)
        lasting = {name: _Lasting(turn_s / _PAUSES) for name in self._requests}
        for name in itertools.cycle(("", *lasting)):
            if subject.others.proved or subject.now_ns >= until_ns:
                break
            if not name:
                self._look(turn_s)
            turn_ends_ns = subject.now_ns + round(turn_s * _NS)
            while name and not subject.others.proved and subject.now_ns < turn_ends_ns:
                self._set_and_look(name, lasting[name])
        for name, each in lasting.items():
            for _ in range(_LONGER_ROUNDS):
                if each.changed_s < _NEVER_S and not subject.others.proved:
                    each.pause_s = _LONGER * each.changed_s
                    self._set_and_look(name, each)

    def _look(self, for_s: float) -> None:
        """Read everything, wait, and read it again."""
        before = {name: self._read(name) for name in self._names}
        self._line.wait(for_s)
        for name, was in before.items():
            now = self._read(name)
            if was is not None and now is not None:
                self._has_changed(name, was.value, now.value)

    def _set_and_look(self, name: str, lasting: _Lasting) -> None:
        """Set a setting again, read it, wait, and read it again."""
        setting = self._subject.others.settings[name]
        was = self._read(name, self._requests[name])
        self._line.wait(lasting.pause_s)
        now = self._read(name)
        if was is None or now is None or not setting.same(setting.last_set, was.value):
            return
        if setting.same(was.value, now.value, loose=_LOOSE):
            lasting.stayed_s = max(lasting.stayed_s, now.asked_s - was.answered_s)
            lasting.pause_s *= _LONGER
        elif self._has_changed(name, was.value, now.value):
            lasting.pause_s = max(_SHORTER * lasting.pause_s, _SHORTEST_S)
            if now.answered_s - was.asked_s < lasting.changed_s:
                lasting.changed_s = now.answered_s - was.asked_s
                lasting.change = was.value, now.value
        if lasting.changed_s <= lasting.stayed_s:
            self._subject.others.prove(name, *lasting.change)

    def _has_changed(self, name: str, was: Any, now: Any) -> bool:
        """Whether a setting has another value and keeps it: proof if that is not explained."""
        setting = self._subject.others.settings[name]
        if setting.same(was, now, loose=_LOOSE) or self._read(name, times=_OFTEN) is None:
            return False
        if not setting.is_explained(now):
            self._subject.others.prove(name, was, now)
        return True

    def _read(self, name: str, data: bytes | None = None, times: int = _TWICE) -> _Reading | None:
        asked_s = self._subject.now_ns / _NS
        value = _read(self._subject, self._line, name, data, times)
        return None if value is None else _Reading(value, asked_s, self._subject.now_ns / _NS)


def _read(
    subject: ControllerUnderTest,
    line: OutgoingConnection,
    name: str,
    data: bytes | None = None,
    times: int = 1,
) -> Any:
    """Set a setting if there is data, and read it several times in a row.

    All is sent together if the controller takes that, so that no other client comes in between.

    Returns:
        The value; None if it varies, or if the controller does not tell it.
    """
    query, setting = QUERIES[name], subject.others.settings[name]
    if query in subject.ics.unsupported | subject.unanswered:
        return None
    with suppress(NoReply):
        if name == PROGRAMS:
            setting.read = False
            program_names(subject, line)
            return setting.expected if setting.read else None
        requests = [] if data is None else [line.request(SETTERS[name], data=data)]
        requests += [line.request(query)] * times
        answers = _answers(subject, line, requests)
        values = [reported(answer.seen) for answer in answers if answer.seen.name == query]
        varies = any(each is None or not setting.same(values[0], each) for each in values)
        return None if varies else values[-1]
    return None


def _answers(
    subject: ControllerUnderTest, line: OutgoingConnection, requests: list[Frame]
) -> list[ReceivedFrame]:
    """Send requests together, or one after another if the controller takes only one at a time."""
    if subject.dialect["pipelining"] != "one":
        line.send_bytes(b"".join(frame.encode() for frame in requests))
        return [line.reply(BY_OPCODE[frame.opcode].name) for frame in requests]
    answers = []
    for frame in requests:
        line.send_frame(frame)
        answers.append(line.reply(BY_OPCODE[frame.opcode].name))
    return answers
