"""Watch: checks after a failure whether settings change while the suite sends only queries.

A fault of the controller must not be mistaken for another client. A change counts only if the
setting does not vary all the time. A change to a value that no request of the suite explains is
proof. A value of the start or of the suite may also come back because the controller forgets the
last value. A controller forgets after a fixed time, a client acts at any time: a change that comes
sooner than a value has lasted before is proof.
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
from scaraspec.suite.controller.harness.requests.ports import outputs, set_output
from scaraspec.suite.controller.harness.setting_values import (
    CLOCK,
    DEFAULT_PROGRAM,
    GRIPPER_CENTRE,
    INITIAL_POSITION,
    OUTPUTS,
    PROGRAMS,
    QUERIES,
    SETTERS,
    reported,
)
from scaraspec.suite.controller.harness.state.defaults import default_program_preserved
from scaraspec.suite.controller.harness.state.preserve import settings_preserved
from scaraspec.suite.engine.connection import ReceivedFrame
from scaraspec.suite.engine.deadline import Deadline
from scaraspec.suite.engine.expectations import CaseFailed, CaseInconclusive, NoReply
from scaraspec.suite.program_files.listed import program_names, store_program

_SET_AGAIN: Final = (CLOCK, GRIPPER_CENTRE, INITIAL_POSITION)
"""Settings that are set to another value, to detect a client that sets the old one."""
_NOON: Final = b"20240615120000"
"""The clock is set to this time, after which only seconds and minutes roll over."""

_TURNS: Final = 10
"""The number of turns. In each, all settings are read, or one is set again."""
_PAUSES: Final = 4
"""The initial number of pauses in a turn."""
_SHORTER: Final = 0.5
_LONGER: Final = 1.5
_SHORTEST_S: Final = 0.002
"""The pause after a setting gets shorter after a change and longer otherwise. So some values last
longer than the period of a client that acts periodically, and others do not."""
_LONGER_ROUNDS: Final = 3
_TWICE: Final = 2
_OFTEN: Final = 12
"""How often in a row a setting must report a value: before a change, and after it."""
_CLOCK_TOLERANCE: Final = 2.0
"""A clock that stops or runs three times as fast is a fault, not another client."""
_NEVER_S: Final = float("inf")
_NS: Final = 1e9


def watch(subject: ControllerUnderTest, for_s: float) -> None:
    """Read the settings that the failed case depends on again, and watch those that deviated.

    The result is in `subject.others`.

    Args:
        subject: The controller, at rest.
        for_s: How long to watch, in seconds.
    """
    others = subject.others
    with suppress(CaseFailed, CaseInconclusive):
        line = subject.open()
        read = {name for name in others.touched if _read(subject, line, name) is not None}
        if read & others.deviating.keys() and not others.proved:
            names = [name for name in QUERIES if _read(subject, line, name) is not None]
            with _set_again(subject, line, others.deviating) as requests:
                _Watch(subject, line, names, requests).run(for_s)
        if OUTPUTS in others.deviating and Hazard.MOTION in subject.allowed:
            _confirm_outputs(line)
        subject.delete_own_files(line)
    subject.close_lines()


def _confirm_outputs(line: OutgoingConnection) -> None:
    """Set the outputs to the reported values, so that the judge expects these from now on."""
    for port, on in enumerate(outputs(line), 1):
        set_output(line, port, on=on)


@contextmanager
def _set_again(
    subject: ControllerUnderTest, line: OutgoingConnection, names: Collection[str]
) -> Iterator[dict[str, bytes]]:
    """Yield the requests to set in turn, by name. Restore the current values afterwards.

    After this, the judge compares with the current values and no longer with earlier ones.
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


class _Sample(NamedTuple):
    """A value, and when it was requested and answered, in seconds."""

    value: Any
    requested_s: float
    answered_s: float


@dataclass
class _Lasting:
    """How long the values of one setting have lasted after it was set again, in seconds.

    Attributes:
        pause_s: How long to wait in the next round.
        stayed_s: The longest time for which a value has lasted.
        changed_s: The shortest time within which a value has changed.
        change: The value before and after this change.
    """

    pause_s: float
    stayed_s: float = 0.0
    changed_s: float = _NEVER_S
    change: tuple[Any, Any] = (None, None)


class _Watch:
    """Watches the settings once.

    Args:
        subject: The controller.
        line: A connection.
        names: The settings to watch.
        requests: The requests to set in turn, by name.
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
        """Watch until another client is proved, for about `for_s` seconds at most.

        Raises:
            CaseFailed: The controller does not answer.
        """
        subject, turn_s = self._subject, for_s / _TURNS
        deadline = Deadline(subject, for_s)
        lasting = {name: _Lasting(turn_s / _PAUSES) for name in self._requests}
        for name in itertools.cycle(("", *lasting)):
            if subject.others.proved or deadline.expired:
                break
            if not name:
                self._look(turn_s)
            turn = Deadline(subject, turn_s)
            while name and not (subject.others.proved or turn.expired):
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
        """Set a setting, read it, wait, and read it again."""
        setting = self._subject.others.settings[name]
        was = self._read(name, self._requests[name])
        self._line.wait(lasting.pause_s)
        now = self._read(name)
        if was is None or now is None or not setting.same(setting.last_set, was.value):
            return
        if setting.same(was.value, now.value, loose=_CLOCK_TOLERANCE):
            lasting.stayed_s = max(lasting.stayed_s, now.requested_s - was.answered_s)
            lasting.pause_s *= _LONGER
        elif self._has_changed(name, was.value, now.value):
            lasting.pause_s = max(_SHORTER * lasting.pause_s, _SHORTEST_S)
            if now.answered_s - was.requested_s < lasting.changed_s:
                lasting.changed_s = now.answered_s - was.requested_s
                lasting.change = was.value, now.value
        if lasting.changed_s <= lasting.stayed_s:
            self._subject.others.prove(name, *lasting.change)

    def _has_changed(self, name: str, was: Any, now: Any) -> bool:
        """Whether a setting has a new, stable value. An unexplained value proves another client."""
        setting = self._subject.others.settings[name]
        if setting.same(was, now, loose=_CLOCK_TOLERANCE) or self._read(name, times=_OFTEN) is None:
            return False
        if not setting.is_explained(now):
            self._subject.others.prove(name, was, now)
        return True

    def _read(self, name: str, data: bytes | None = None, times: int = _TWICE) -> _Sample | None:
        requested_s = self._subject.now_ns / _NS
        value = _read(self._subject, self._line, name, data, times)
        return None if value is None else _Sample(value, requested_s, self._subject.now_ns / _NS)


def _read(
    subject: ControllerUnderTest,
    line: OutgoingConnection,
    name: str,
    data: bytes | None = None,
    times: int = 1,
) -> Any:
    """Read a setting several times in a row; set it first if `data` is given.

    All requests are sent together if the controller permits it, so that no other client acts in
    between.

    Returns:
        The value; None if it varies or is not reported.
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
    """Send requests together, or one by one if the controller serves only one at a time."""
    if subject.dialect["pipelining"] != "one":
        line.send_bytes(b"".join(frame.encode() for frame in requests))
        return [line.reply(BY_OPCODE[frame.opcode].name) for frame in requests]
    answers = []
    for frame in requests:
        line.send_frame(frame)
        answers.append(line.reply(BY_OPCODE[frame.opcode].name))
    return answers
