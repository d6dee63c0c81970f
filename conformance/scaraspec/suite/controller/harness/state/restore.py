"""Restore: reads the settings and the program list before a run, and restores them after it.

Only values that the suite may have changed are restored. Other changes are reported and kept,
because another client may have made them on purpose.
"""

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Any, Final, NamedTuple

from scaraspec.protocol.commands import Network, Point, PortValue, Pose
from scaraspec.protocol.hazard import Hazard
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.guard import EVERYTHING
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.clock import shifted_time
from scaraspec.suite.controller.harness.state.password import restore_password, set_value
from scaraspec.suite.engine.expectations import CaseFailed, CaseInconclusive, NoReply, expect
from scaraspec.suite.engine.journal import JournalError
from scaraspec.suite.program_files.listed import program_names
from scaraspec.user_message import UserMessage

_CLOCK_SLACK_S: Final = 2
_HALF_S: Final = 0.5
_RESTART_S: Final = 10
_RETRY_S: Final = 1
_NS: Final = 1_000_000_000
DEFAULT_PROGRAM: Final = "default program"
_MAYBE_REFUSED: Final = (DEFAULT_PROGRAM, "initial tool position")
_PROGRAMS: Final = "programs"
_CLOCK: Final = "clock"


@dataclass(frozen=True, slots=True)
class Item:
    """One thing that a run may change.

    Attributes:
        name: Its name.
        hazard: The hazard that must be allowed to change and restore it.
        read: Returns its value as JSON types; None if the controller reports none.
        write: Sets its value.
        differs: Whether the current and the earlier value differ.
    """

    name: str
    hazard: Hazard
    read: Callable[[ControllerUnderTest, OutgoingConnection], Any]
    write: Callable[[ControllerUnderTest, OutgoingConnection, Any], None]
    differs: Callable[[ControllerUnderTest, Any, Any], bool] = lambda _, now, before: bool(
        now != before
    )


def snapshot(subject: ControllerUnderTest, line: OutgoingConnection) -> dict[str, Any]:
    """Return the settings and the program list, by the names of `ITEMS`; None without a value.

    Outputs are omitted if the suite switches none, because a program of the user may switch them.
    """
    items = (i for i in ITEMS if i.hazard is not Hazard.MOTION or i.hazard in subject.allowed)
    return {item.name: _read(item, subject, line) for item in items}


def restorable_settings(
    subject: ControllerUnderTest, line: OutgoingConnection, before: Mapping[str, Any]
) -> dict[str, Any]:
    """Return a snapshot without the settings that the controller does not accept.

    A controller refuses a default program that is not stored, or a position that was never set. No
    run could restore them.
    """
    state = dict(before)
    for item in ITEMS:
        if item.name in _MAYBE_REFUSED and item.hazard in subject.allowed and state[item.name]:
            try:
                item.write(subject, line, state[item.name])
            except JournalError:
                raise
            except (CaseFailed, CaseInconclusive):
                state[item.name] = None
    return state


class Differences(NamedTuple):
    """The differences from the state at the start, one sentence each.

    Attributes:
        ours: What the suite has changed and could not restore.
        others: What the suite has not changed or cannot restore.
    """

    ours: list[str]
    others: list[str]


def restore(subject: ControllerUnderTest) -> Differences:
    """Bring the robot to rest, restore what the run has changed, and compare with the start.

    Returns:
        The differences that remain.
    """
    before, changed = subject.journal.changes.settings, subject.journal.changes.changed
    left = Differences([], [])
    with subject.journal.restoring():
        try:
            line = _connect_at_rest(subject)
        except (CaseFailed, CaseInconclusive) as error:
            return Differences([UserMessage("nothing could be restored: {error}", error=error)], [])
        for item in ITEMS:
            if before.get(item.name) is None:
                continue
            ours = item.name != _PROGRAMS and not {item.name, EVERYTHING}.isdisjoint(changed)
            if problem := _restore_item(item, subject, line, before[item.name], ours=ours):
                (left.ours if ours else left.others).append(problem)
        line.close()
    if not left.ours:
        subject.journal.confirm("restored")
    return left


def _restore_item(
    item: Item, subject: ControllerUnderTest, line: OutgoingConnection, expected: Any, *, ours: bool
) -> str:
    """Restore one item if the suite may have changed it. Return the remaining difference."""
    try:
        now = _read(item, subject, line)
        if item.name == _CLOCK and ours and not item.differs(subject, now, expected):
            now = _set_clock_again(item, subject, line, expected)
        if not item.differs(subject, now, expected):
            return ""
        if item.name == _PROGRAMS:
            return _program_differences(subject, line, now, expected)
        if not ours:
            return UserMessage(
                "the {item} was {before} at the start and is {now}: the suite has not set it",
                item=item.name,
                before=shown(item, expected),
                now=shown(item, now),
            )
        expect(
            item.hazard in subject.allowed,
            UserMessage("restoring it needs --allow {hazard}", hazard=item.hazard.value),
        )
        item.write(subject, line, expected)
        now = _read(item, subject, line)
        expect(
            not item.differs(subject, now, expected),
            UserMessage("it is still {value}", value=shown(item, now)),
        )
    except (CaseFailed, CaseInconclusive) as error:
        return UserMessage(
            "the {item} could not be restored to {before}: {error}",
            item=item.name,
            before=shown(item, expected),
            error=error,
        )
    return ""


def _set_clock_again(
    clock: Item, subject: ControllerUnderTest, line: OutgoingConnection, expected: Any
) -> Any:
    """Set the clock again although it is within its tolerance.

    Each case that restores the clock adds a small error.
    """
    with suppress(CaseFailed, CaseInconclusive):
        if clock.hazard in subject.allowed:
            clock.write(subject, line, expected)
    return _read(clock, subject, line)


def _program_differences(
    subject: ControllerUnderTest,
    line: OutgoingConnection,
    now: list[str] | None,
    expected: list[str],
) -> str:
    """Return the differences of the program list. The files of the suite are deleted before.

    A new default program may be undeletable if there was none at the start (A-4.11-1).
    """
    if now is None:
        return "the program list cannot be read, so it was not compared with that of the start"
    added, missing = sorted({*now} - {*expected}), sorted({*expected} - {*now})
    differences = []
    for name in added:
        if subject.files.is_own(name.encode("latin-1")):
            subject.files.note_stored(name.encode("latin-1"))  # the next run deletes it
    if added:
        default = _read_default(subject, line)
        listed = [
            UserMessage("{name} (the default program)", name=n) if n == default else n
            for n in added
        ]
        differences.append(
            UserMessage("{names} was not listed at the start", names=UserMessage.listed(listed))
        )
    if missing:
        differences.append(UserMessage("{names} is not listed any more", names=", ".join(missing)))
    return UserMessage(
        "the program list differs: {differences}",
        differences=UserMessage.listed(differences, semicolons=True),
    )


def shown(item: Item, value: Any) -> str:
    """Return the value of an item as a sentence shows it."""
    match value:
        case None:
            return "unknown"
        case [ahead_s, _] if item.name == _CLOCK:
            return UserMessage("{ahead_s:+.0f} s from the clock of this computer", ahead_s=ahead_s)
        case list():
            return "|".join(map(str, value))
    return f"{value}"


def _connect_at_rest(subject: ControllerUnderTest) -> OutgoingConnection:
    """Return a connection to the robot at rest. A crashed controller has time to restart.

    Raises:
        CaseFailed: The controller cannot be reached.
        CaseInconclusive: The robot does not come to rest.
    """
    begun_ns = subject.now_ns
    while True:
        try:
            restore_password(subject)
            subject.settle()
            return subject.open()
        except NoReply:
            if subject.now_ns - begun_ns > _RESTART_S * _NS:
                raise
        subject.close_lines()
        subject.pause(_RETRY_S)


def _read(item: Item, subject: ControllerUnderTest, line: OutgoingConnection) -> Any:
    try:
        return item.read(subject, line)
    except (CaseFailed, CaseInconclusive):  # the cases report this
        return None


# ---------------------------------------------------------------------- what there is


def _read_programs(subject: ControllerUnderTest, line: OutgoingConnection) -> list[str]:
    return sorted(name.decode("latin-1") for name in program_names(subject, line))


def _delete_own(subject: ControllerUnderTest, line: OutgoingConnection, _: list[str]) -> None:
    """Delete the files of the suite."""
    subject.delete_own_files(line)


def _read_clock(subject: ControllerUnderTest, line: OutgoingConnection) -> list[float] | None:
    """Return how far its clock is ahead of ours, and the time of the query, both in seconds."""
    value = line.ask("get_time").value
    if value is None:
        return None
    ahead_s: float = (value - _own_time(subject)).total_seconds()
    return [ahead_s + _HALF_S, subject.now_ns / _NS]  # the reply has whole seconds


def _ahead_s(subject: ControllerUnderTest, before: list[float]) -> float:
    """Return the expected lead of the controller's clock over ours now, in seconds.

    The lead grows if the clock of a simulator is faster than real time.
    """
    ahead_s, at_s = before
    return ahead_s + (subject.ics.time_scale - 1) * (subject.now_ns / _NS - at_s)


def _clock_differs(
    subject: ControllerUnderTest, now: list[float] | None, before: list[float]
) -> bool:
    if now is None:
        return True
    slack_s = _CLOCK_SLACK_S * max(subject.ics.time_scale, 1)
    return abs(now[0] - _ahead_s(subject, before)) > slack_s


def _write_clock(
    subject: ControllerUnderTest, line: OutgoingConnection, before: list[float]
) -> None:
    ahead_s = _ahead_s(subject, before)
    time = shifted_time(_own_time(subject), timedelta(seconds=ahead_s + _HALF_S))
    set_value(line, "set_time", time.replace(microsecond=0))


def _own_time(subject: ControllerUnderTest) -> datetime:
    return datetime.fromtimestamp(subject.now_ns / _NS, UTC).replace(tzinfo=None)


def _read_default(_: ControllerUnderTest, line: OutgoingConnection) -> str | None:
    value = line.ask("get_default_program").value
    return value.decode("latin-1") if value else None


def write_default(_: ControllerUnderTest, line: OutgoingConnection, name: str) -> None:
    """Set the default program to the bytes that were reported."""
    set_value(line, "set_default_program", data=name.encode("latin-1"))


def _read_outputs(_: ControllerUnderTest, line: OutgoingConnection) -> str | None:
    value = line.ask("get_digital_outputs").value
    return value if isinstance(value, str) else None


def _write_outputs(subject: ControllerUnderTest, line: OutgoingConnection, digits: str) -> None:
    now = _read_outputs(subject, line) or ""
    for port, (digit, expected) in enumerate(zip(reversed(now), reversed(digits), strict=False), 1):
        if digit != expected:
            set_value(line, "set_digital_output", PortValue(port, int(expected)))


def _read_numbers(
    name: str,
) -> Callable[[ControllerUnderTest, OutgoingConnection], list[Any] | None]:
    def read(_: ControllerUnderTest, line: OutgoingConnection) -> list[Any] | None:
        value = line.ask(name).value
        return None if value is None else list(value)

    return read


def _write_tuple(
    name: str, make: type
) -> Callable[[ControllerUnderTest, OutgoingConnection, list[Any]], None]:
    def write(_: ControllerUnderTest, line: OutgoingConnection, values: list[Any]) -> None:
        set_value(line, name, make(*values))

    return write


ITEMS: Final = (
    Item(_CLOCK, Hazard.STATE, _read_clock, _write_clock, _clock_differs),
    Item(DEFAULT_PROGRAM, Hazard.STATE, _read_default, write_default),
    Item(_PROGRAMS, Hazard.STATE, _read_programs, _delete_own),
    Item(
        "gripper centre",
        Hazard.STATE,
        _read_numbers("get_gripper_center"),
        _write_tuple("set_gripper_center", Point),
    ),
    Item(
        "initial tool position",
        Hazard.STATE,
        _read_numbers("get_initial_tool_position"),
        _write_tuple("set_initial_tool_position", Pose),
    ),
    Item("outputs", Hazard.MOTION, _read_outputs, _write_outputs),
    Item(
        "network",
        Hazard.DESTRUCTIVE,
        _read_numbers("get_network"),
        _write_tuple("set_network", Network),
    ),
)
"""Everything that a run may change except the password."""
