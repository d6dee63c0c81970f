"""Restore: what a run may change, written down before and put back after, also after an interrupt.

The state stays in a file until it is put back, so that the next run can put back what one that was
killed has left. Passwords are not written: the one that the tester names is set again.
"""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any, Final

from scaraspec.protocol.commands import Network, PasswordChange, Point, PortValue, Pose
from scaraspec.protocol.hazard import Hazard
from scaraspec.suite.as_client.asking.clock import shifted
from scaraspec.suite.as_client.line import Line
from scaraspec.suite.as_client.subject import OTHER_PASSWORDS, STEM, Subject
from scaraspec.suite.expect import NoAnswer, Undecided, Unmet, expect
from scaraspec.suite.programs.listed import program_names

_CLOCK_SLACK_S: Final = 2
_HALF_S: Final = 0.5
_COMES_BACK_S: Final = 10
_ONCE_MORE_S: Final = 1
_NS: Final = 1_000_000_000
_BUFFERS_BYTES: Final = (64, 63, 32, 31, 30, 20, 16, 15, 10, 8)
_REFUSED_PERHAPS: Final = ("default program", "initial tool position")


@dataclass(frozen=True, slots=True)
class Item:
    """One thing that a run may change.

    Attributes:
        name: What it is called.
        hazard: It is only changed, and put back, where this is allowed.
        read: Asks for it; None where the subject does not say. Gives what JSON can hold.
        write: Sets it.
    """

    name: str
    hazard: Hazard
    read: Callable[[Subject, Line], Any]
    write: Callable[[Subject, Line, Any], None]


def save(subject: Subject) -> dict[str, Any]:
    """Ask for everything that this run may change.

    A setting that the subject refuses to take back even now, as a default program that is not
    stored or a position that was never set, is none that a run could put back.

    Raises:
        Unmet: The subject cannot be reached, or refuses the login.
    """
    line = subject.open()
    items = [item for item in ITEMS if item.hazard in subject.allowed]
    state = {item.name: _read(item, subject, line) for item in items}
    for item in items:
        if item.name in _REFUSED_PERHAPS and state[item.name]:
            try:
                item.write(subject, line, state[item.name])
            except (Unmet, Undecided):
                state[item.name] = None
    line.close()
    return state


def restore(subject: Subject, state: Mapping[str, Any]) -> list[str]:
    """Bring the subject to rest and put back what differs.

    Returns:
        A sentence for each thing that could not be put back.
    """
    problems = []
    try:
        line = _reached(subject)
    except (Unmet, Undecided) as error:
        return [f"nothing could be put back: {error}"]
    for item in ITEMS:
        wanted = state.get(item.name)
        try:
            if wanted is not None and _differs(_read(item, subject, line), wanted):
                expect(item.hazard in subject.allowed, f"it wants --allow {item.hazard.value}")
                item.write(subject, line, wanted)
        except (Unmet, Undecided) as error:
            problems.append(f"the {item.name} could not be put back to {wanted}: {error}")
    line.close()
    return problems


def _reached(subject: Subject) -> Line:
    """A connection to the subject at rest; who has just crashed has time to come back.

    Raises:
        Unmet: It cannot be reached.
        Undecided: It does not come to rest.
    """
    begun_ns = subject.now_ns
    while True:
        try:
            restore_password(subject)
            subject.settle()
            return subject.open()
        except NoAnswer:
            if subject.now_ns - begun_ns > _COMES_BACK_S * _NS:
                raise
        subject.close_lines()
        subject.pause(_ONCE_MORE_S)


def load(path: Path) -> dict[str, Any]:
    """The state that a run which was killed has left; empty where none can be read."""
    try:
        state = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return state if isinstance(state, dict) else {}


def keep(path: Path, state: Mapping[str, Any]) -> None:
    """Write a state down.

    Raises:
        OSError: It cannot be written.
    """
    path.write_text(json.dumps(state, indent=1) + "\n", encoding="utf-8")


def _read(item: Item, subject: Subject, line: Line) -> Any:
    try:
        return item.read(subject, line)
    except (Unmet, Undecided):  # of that, too, the cases are the judges
        return None


def _differs(value: Any, wanted: Any) -> bool:
    if isinstance(wanted, int) and isinstance(value, int):
        return abs(value - wanted) > _CLOCK_SLACK_S
    return bool(value != wanted)


def _as_kept_wrongly() -> list[bytes]:
    """What a faulty subject may have made of a new password: nobody could log in again."""
    cut = [each[:size] for each in OTHER_PASSWORDS for size in _BUFFERS_BYTES if size < len(each)]
    ways: tuple[Callable[[bytes], bytes], ...] = (
        bytes.lower,
        bytes.upper,
        lambda each: each.lstrip(b"0"),
    )
    return [*cut, *(way(each) for each in OTHER_PASSWORDS for way in ways)]


def restore_password(subject: Subject) -> None:
    """Set the password again that the tester named, if a case or the subject has left another.

    What opens a login need not be the password: a faulty subject may look at its beginning alone.

    Raises:
        Unmet: The subject does not answer, or refuses to.
    """
    if Hazard.DESTRUCTIVE not in subject.allowed or not subject.access.needs_login:
        return
    refused: Unmet | None = None
    for password in dict.fromkeys((subject.password, *OTHER_PASSWORDS, *_as_kept_wrongly())):
        line = subject.open(login=False)
        opened = bool(line.ask("login", password).accepted)
        if opened and password != subject.password:
            try:
                _set(line, "set_password", PasswordChange(password, subject.password))
            except NoAnswer:
                raise
            except Unmet as error:
                refused, opened = error, False
        line.close()
        if opened:
            return
    if refused is not None:
        raise refused


def _set(line: Line, name: str, value: Any = None, *, data: bytes | None = None) -> None:
    answer = line.ask(name, value, data=data)
    expect(answer.accepted, f"{name} was refused", expected="1", observed=f"{answer}")


# ---------------------------------------------------------------------- what there is


def _read_programs(subject: Subject, line: Line) -> list[str]:
    return sorted(name.decode("latin-1") for name in program_names(subject, line))


def _remove_programs(subject: Subject, line: Line, wanted: list[str]) -> None:
    """Delete what the suite has left, unless the default program has to stay (A-4.11-1).

    Files of others are not touched.
    """
    for name in _read_programs(subject, line):
        if name in wanted or not name.startswith(STEM):
            continue
        answer = line.ask("delete_program", name.encode("latin-1"))
        stays = not answer.accepted and name == _read_default(subject, line)
        expect(answer.accepted or stays, f"{name} cannot be deleted", observed=f"{answer}")


def _read_clock(subject: Subject, line: Line) -> int | None:
    """How far its clock is ahead of ours, in seconds."""
    value = line.ask("get_time").value
    if value is None:
        return None
    ahead_s: float = (value - _ours(subject)).total_seconds()
    return round(ahead_s + _HALF_S)  # it shows whole seconds


def _write_clock(subject: Subject, line: Line, ahead_s: int) -> None:
    time = shifted(_ours(subject), timedelta(seconds=ahead_s + _HALF_S))
    _set(line, "set_time", time.replace(microsecond=0))


def _ours(subject: Subject) -> datetime:
    return datetime.fromtimestamp(subject.now_ns / _NS, UTC).replace(tzinfo=None)


def _read_default(_: Subject, line: Line) -> str | None:
    value = line.ask("get_default_program").value
    return value.decode("latin-1") if value else None


def _write_default(_: Subject, line: Line, name: str) -> None:
    """Set it by the bytes that were told, be they a name or not."""
    _set(line, "set_default_program", data=name.encode("latin-1"))


def _read_outputs(_: Subject, line: Line) -> str | None:
    value = line.ask("get_digital_outputs").value
    return value if isinstance(value, str) else None


def _write_outputs(subject: Subject, line: Line, digits: str) -> None:
    now = _read_outputs(subject, line) or ""
    for port, (digit, wanted) in enumerate(zip(reversed(now), reversed(digits), strict=False), 1):
        if digit != wanted:
            _set(line, "set_digital_output", PortValue(port, int(wanted)))


def _read_numbers(name: str) -> Callable[[Subject, Line], list[Any] | None]:
    def read(_: Subject, line: Line) -> list[Any] | None:
        value = line.ask(name).value
        return None if value is None else list(value)

    return read


def _write_tuple(name: str, make: type) -> Callable[[Subject, Line, list[Any]], None]:
    def write(_: Subject, line: Line, values: list[Any]) -> None:
        _set(line, name, make(*values))

    return write


ITEMS: Final = (
    Item("clock", Hazard.STATE, _read_clock, _write_clock),
    Item("default program", Hazard.STATE, _read_default, _write_default),
    Item("programs", Hazard.STATE, _read_programs, _remove_programs),
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
