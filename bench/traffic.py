"""Traffic: requests and replies of a client that polls its robot, of any length.

Lives here: the frames and their times, made from the command table. Every value that a robot in
motion would change does change. Nothing here opens a link, and nothing waits.
"""

import math
from collections.abc import Iterator
from typing import Any, Final, NamedTuple

from scaraspec.protocol.commands import (
    BY_NAME,
    Command,
    JointValues,
    MoveTarget,
    Pose,
)
from scaraspec.protocol.direction import A2C, C2A, Direction
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.payloads import Acceptance, Outcome

SECOND_NS: Final = 1_000_000_000

_REPLY_NS: Final = 1_500_000
_MOVE_EVERY: Final = 2_000  # exchanges: ten seconds of 200 a second
_MOVE_LASTS: Final = 300
_ARM_MM: Final = 200.0
_PLACES: Final = 3  # decimals
_PLACE: Final = ("get_status", "get_joint_angles", "get_tool_coordinates")
_RARE: Final = (
    "get_motor_temperatures",
    "get_digital_outputs",
    "get_analog_input",
    "get_running_program",
)
_POLLED: Final = tuple(
    name for rare in _RARE for name in (*_PLACE, "get_digital_inputs", *_PLACE, rare)
)
"""The requests in turn: mostly positions of the arm."""


class Sent(NamedTuple):
    """One frame: time, sender and bytes."""

    time_ns: int
    direction: Direction
    data: bytes


def poll(start_ns: int, exchanges: int, per_second: int) -> Iterator[Sent]:
    """Yield the frames of this number of exchanges: a login, then polling with some moves.

    Args:
        start_ns: The time of the first, in nanoseconds since the Unix epoch.
        exchanges: How many requests.
        per_second: How many a second.
    """
    for number in range(exchanges):
        time_ns = start_ns + number * SECOND_NS // per_second
        if number > _MOVE_EVERY and number % _MOVE_EVERY == _MOVE_LASTS:
            yield Sent(time_ns, C2A, _done(BY_NAME["set_tool_coordinates"]))
        name, value, answer = _question(number)
        command = BY_NAME[name]
        yield Sent(time_ns, A2C, _frame(command, A2C, command.request.encode(value)))
        yield Sent(time_ns + _REPLY_NS, C2A, _frame(command, C2A, command.reply.encode(answer)))


def _question(number: int) -> tuple[str, Any, Any]:
    """Return command, argument and reply of an exchange."""
    if not number:
        return "login", b"password", True
    moves, since = divmod(number, _MOVE_EVERY)
    if not since:
        target = MoveTarget(50, *_pose(_turn_deg(moves)))
        return "set_tool_coordinates", target, Acceptance(accepted=True)
    moving = moves > 0 and since < _MOVE_LASTS
    turn_deg = _turn_deg(moves - 1 + since / _MOVE_LASTS if moving else moves)
    name = _POLLED[number % len(_POLLED)]
    return name, 1 if name == "get_analog_input" else None, _answer(name, number, turn_deg, moving)


def _answer(name: str, number: int, turn_deg: float, moving: bool) -> Any:  # noqa: FBT001 - private
    warm = round(40 + 10 * math.sin(number / 9970), _PLACES)
    answers = {
        "get_status": "04" if moving else "00",
        "get_joint_angles": JointValues(turn_deg, -turn_deg / 2, 30.0, 45.0),
        "get_tool_coordinates": _pose(turn_deg),
        "get_motor_temperatures": JointValues(warm, warm, 35.5, 33.0),
        "get_digital_inputs": f"{number // 800 % 256:08b}",
        "get_digital_outputs": f"{number // 400 % 65536:016b}",
        "get_analog_input": round(50 + 40 * math.sin(number / 970), _PLACES),
        "get_running_program": None,
    }
    return answers[name]


def _turn_deg(moves: float) -> float:
    """Return the angle of the arm after the moves; the last one may be in progress."""
    return round(60 * math.sin(moves), _PLACES)


def _pose(turn_deg: float) -> Pose:
    """Return the tool position at this angle."""
    turn = math.radians(turn_deg)
    x = _ARM_MM * (math.cos(turn) + math.cos(turn / 2))
    y = _ARM_MM * (math.sin(turn) + math.sin(turn / 2))
    return Pose(round(x, _PLACES), round(y, _PLACES), 30.0, 45.0, 0.0, 0.0)


def _done(command: Command) -> bytes:
    assert command.result
    data = command.result.encode(Outcome(done=True))
    return Frame(C2A, command.opcode, data, tagged=True).encode()


def _frame(command: Command, direction: Direction, data: bytes) -> bytes:
    return Frame(direction, command.opcode, data).encode()
