"""Restore: the settings and the program list, read before a run and compared and put back after it.

Only what the suite may have changed is put back. What has changed otherwise is reported and left
as it is: another client may have changed it on purpose.
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
_COMES_BACK_S: Final = 10
_ONCE_MORE_S: Final = 1
_NS: Final = 1_000_000_000
DEFAULT_PROGRAM: Final = "default program"
_REFUSED_PERHAPS: Final = (DEFAULT_PROGRAM, "initial tool position")
_PROGRAMS: Final = "programs"
_CLOCK: Final = "clock"


@dataclass(frozen=True, slots=True)
class Item:
    """One thing that a run may change.

    Attributes:
        name: What it is called.
        hazard: It is only changed, and put back, where this is allowed.
        read: Asks for it; None where the subject does not say. Gives what JSON can hold.
        write: Sets it.
        differs: Whether what it is now, and what it was, are not the same.
    """

    name: str
    hazard: Hazard
    read: Callable[[ControllerUnderTest, OutgoingConnection], Any]
    write: Callable[[ControllerUnderTest, OutgoingConnection, Any], None]
    differs: Callable[[ControllerUnderTest, Any, Any], bool] = lambda _, now, before: bool(
        now != before
    )


def snapshot(subject: ControllerUnderTest, line: OutgoingConnection) -> dict[str, Any]:
    """The settings and the program list, by the names of `ITEMS`; None if there is no value.

    Outputs are left out where the suite switches none: a program of the user may switch them.
    """
    items = (i for i in ITEMS if i.hazard is not Hazard.MOTION or i.hazard in subject.allowed)
    return {item.name: _read(item, subject, line) for item in items}


def restorable_settings(
    subject: ControllerUnderTest, line: OutgoingConnection, before: Mapping[str, Any]
) -> dict[str, Any]:
    """The settings of a snapshot that the controller takes back.

    It refuses a default program that is not stored, or a position that was never set: no run could
    put them back.
    """
    state = dict(before)
    for item in ITEMS:
        if item.name in _REFUSED_PERHAPS and item.hazard in subject.allowed and state[item.name]:
            try:
                item.write(subject, line, state[item.name])
            except JournalError:
                raise
            except (CaseFailed, CaseInconclusive):
                state[item.name] = None
    return state


class Differences(NamedTuple):
    """What differs from the start, one sentence each.

    Attributes:
        ours: What the suite has changed and could not put back.
        others: What the suite has not changed, or has no means to put back.
    """

    ours: list[str]
    others: list[str]


def restore(subject: ControllerUnderTest) -> Differences:
    """Bring the controller to rest, put back what the run has changed, and compare with the start.

    Returns:
        What remains.
    """
    before, changed = subject.journal.changes.settings, subject.journal.changes.changed
    left = Differences([], [])
    with subject.journal.restoring():
        try:
            line = _reached(subject)
        except (CaseFailed, CaseInconclusive) as error:
            return Differences([f"nothing could be put back: {error}"], [])
        for item in ITEMS:
            if before.get(item.name) is None:
                continue
            ours = item.name != _PROGRAMS and not {item.name, EVERYTHING}.isdisjoint(changed)
            if problem := _put_back(item, subject, line, before[item.name], ours=ours):
                (left.ours if ours else left.others).append(problem)
        line.close()
    if not left.ours:
        subject.journal.confirm("restored")
    return left


def _put_back(
    item: Item, subject: ControllerUnderTest, line: OutgoingConnection, wanted: Any, *, ours: bool
) -> str:
    """Put one item back where the suite may have changed it; what is wrong with it then."""
    try:
        now = _read(item, subject, line)
        if item.name == _CLOCK and ours and not item.differs(subject, now, wanted):
            now = _set_once_more(item, subject, line, wanted)
        if not item.differs(subject, now, wanted):
            return ""
        if item.name == _PROGRAMS:
            return _of_programs(subject, line, now, wanted)
        if not ours:
            return (
                f"the {item.name} was {shown(item, wanted)} at the start and is "
                f"{shown(item, now)}: the suite has not set it"
            )
        expect(
            item.hazard in subject.allowed,
            UserMessage("restoring it needs --allow {hazard}", hazard=item.hazard.value),
        )
        item.write(subject, line, wanted)
        now = _read(item, subject, line)
        expect(
            not item.differs(subject, now, wanted),
            UserMessage("it still is {value}", value=shown(item, now)),
        )
    except (CaseFailed, CaseInconclusive) as error:
        return f"the {item.name} could not be restored to {shown(item, wanted)}: {error}"
    return ""


def _set_once_more(
    clock: Item, subject: ControllerUnderTest, line: OutgoingConnection, wanted: Any
) -> Any:
    """Set a clock that is about right, as it drifts each time that a case puts it back."""
    with suppress(CaseFailed, CaseInconclusive):
        if clock.hazard in subject.allowed:
            clock.write(subject, line, wanted)
    return _read(clock, subject, line)


def _of_programs(
    subject: ControllerUnderTest, line: OutgoingConnection, now: list[str] | None, wanted: list[str]
) -> str:
    """What differs in the program list; the suite's own files have been deleted before.

    The default program may have to stay (A-4.11-1), where there was none before.
    """
    if now is None:
        return "the program list cannot be read, so it was not compared with that of the start"
    more, less = sorted({*now} - {*wanted}), sorted({*wanted} - {*now})
    told = []
    for name in more:
        if subject.files.is_own(name.encode("latin-1")):
            subject.files.note_stored(name.encode("latin-1"))  # the next run deletes it
    if more:
        default = _read_default(subject, line)
        ours = [f"{n} (the default program)" if n == default else n for n in more]
        told.append(f"{', '.join(ours)} was not listed at the start")
    if less:
        told.append(f"{', '.join(less)} is not listed any more")
    return f"the program list differs: {'; '.join(told)}"


def shown(item: Item, value: Any) -> str:
    """A value of an item, as a sentence names it."""
    match value:
        case None:
            return "unknown"
        case [ahead_s, _] if item.name == _CLOCK:
            return f"{ahead_s:+.0f} s from the clock of this computer"
        case list():
            return "|".join(map(str, value))
    return f"{value}"


def _reached(subject: ControllerUnderTest) -> OutgoingConnection:
    """A connection to the subject at rest; who has just crashed has time to come back.

    Raises:
        CaseFailed: It cannot be reached.
        CaseInconclusive: It does not come to rest.
    """
    begun_ns = subject.now_ns
    while True:
        try:
            restore_password(subject)
            subject.settle()
            return subject.open()
        except NoReply:
            if subject.now_ns - begun_ns > _COMES_BACK_S * _NS:
                raise
        subject.close_lines()
        subject.pause(_ONCE_MORE_S)


def _read(item: Item, subject: ControllerUnderTest, line: OutgoingConnection) -> Any:
    try:
        return item.read(subject, line)
    except (CaseFailed, CaseInconclusive):  # of that, too, the cases are the judges
        return None


# ---------------------------------------------------------------------- what there is


def _read_programs(subject: ControllerUnderTest, line: OutgoingConnection) -> list[str]:
    return sorted(name.decode("latin-1") for name in program_names(subject, line))


def _delete_own(subject: ControllerUnderTest, line: OutgoingConnection, _: list[str]) -> None:
    """Delete what the suite has stored; files of others are not touched."""
    subject.delete_own_files(line)


def _read_clock(subject: ControllerUnderTest, line: OutgoingConnection) -> list[float] | None:
    """How far its clock is ahead of ours, and when that was so, both in seconds."""
    value = line.ask("get_time").value
    if value is None:
        return None
    ahead_s: float = (value - _ours(subject)).total_seconds()
    return [ahead_s + _HALF_S, subject.now_ns / _NS]  # it shows whole seconds


def _ahead_s(subject: ControllerUnderTest, before: list[float]) -> float:
    """How far a clock must be ahead now; that of a fast simulator gains all the time."""
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
    time = shifted_time(_ours(subject), timedelta(seconds=ahead_s + _HALF_S))
    set_value(line, "set_time", time.replace(microsecond=0))


def _ours(subject: ControllerUnderTest) -> datetime:
    return datetime.fromtimestamp(subject.now_ns / _NS, UTC).replace(tzinfo=None)


def _read_default(_: ControllerUnderTest, line: OutgoingConnection) -> str | None:
    value = line.ask("get_default_program").value
    return value.decode("latin-1") if value else None


def write_default(_: ControllerUnderTest, line: OutgoingConnection, name: str) -> None:
    """Set it by the reported bytes, whether they are a name or not."""
    set_value(line, "set_default_program", data=name.encode("latin-1"))


def _read_outputs(_: ControllerUnderTest, line: OutgoingConnection) -> str | None:
    value = line.ask("get_digital_outputs").value
    return value if isinstance(value, str) else None


def _write_outputs(subject: ControllerUnderTest, line: OutgoingConnection, digits: str) -> None:
    now = _read_outputs(subject, line) or ""
    for port, (digit, wanted) in enumerate(zip(reversed(now), reversed(digits), strict=False), 1):
        if digit != wanted:
            set_value(line, "set_digital_output", PortValue(port, int(wanted)))


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
"""Everything that a run may change, but for the password."""
