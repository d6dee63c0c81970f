"""Polls: what a client asks of its own accord, and what it is told.

Nothing forbids a client to ask for more than it was ordered to, as a window does that shows the
status ten times a second. Only requests that no case waits for are polls, and only queries, whose
answer changes nothing, the clock's setting, which a client may do when it logs in, and a further
login (A-4.1-2). Which answer a case gives is not known here; once it has given one, polls are told
the same, and once something was set, that it is so: a client may read back what it has set. A list
of programs has those that orders in hand are about: a client may look before it asks for one.
"""

from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from typing import Final

from scaraspec.protocol.direction import A2C, C2A
from scaraspec.protocol.frames import MAX_DATA_BYTES, Frame
from scaraspec.traffic.events import FrameSeen

REPLIES: Final = {
    "get_network": b"192.168.1.2|255.255.255.0|192.168.1.1",
    "get_time": b"20141222143000",
    "get_version": b"1.0.0",
    "get_status": b"00",
    "get_running_program": b"1|myprogram1.txt|00011230",
    "list_programs": b"0|pro1.rob|pro2.rob|pro3.rob",
    "get_default_program": b"pro1.txt",
    "get_motor_temperatures": b"20|38|34|22",
    "get_gripper_center": b"200|300|456",
    "get_initial_tool_position": b"200|300|324|34.6|34.5|0",
    "get_tool_coordinates": b"200|300|324|34.6|34.5|0",
    "get_joint_angles": b"20.4|30.5|38.0|0",
    "get_digital_inputs": b"1|10000000",
    "get_analog_input": b"1|100",
    "get_digital_outputs": b"1|1001000011110000",
}
"""The document's own example of the reply to every query, with the bars that it lost (A-0-1)."""

_TELLS: Final = {
    "set_network": "get_network",
    "set_time": "get_time",
    "set_default_program": "get_default_program",
    "set_gripper_center": "get_gripper_center",
    "set_initial_tool_position": "get_initial_tool_position",
}
"""What sets something, and the query that is answered with the same text from then on."""

FETCHES_PARTS: Final = "fetches parts"
"""Under which name it is known whether the client asks for each part of a list (A-4.10-3)."""
_SET_OUTPUT: Final = "set_digital_output"
_OUTPUTS: Final = "get_digital_outputs"
_ANSWERED: Final = b"1|"
_YES: Final = b"1"
_LIST: Final = "list_programs"
_MORE: Final = b"1"
_AT_ONCE: Final = 16
"""A client on a simulated clock may ask again at the very instant of its answer, for ever."""


class AutoResponder:
    """The polls on one connection.

    Args:
        due: Whether a case still waits for this request.

    Attributes:
        answers: What polls are told, by the name of what is asked.
        logged_in: The client has been let in; before that it may ask for nothing else (L104).
    """

    def __init__(self, due: Callable[[FrameSeen], bool]) -> None:
        self._due = due
        self.logged_in = False
        self._instant_s, self._at_instant = -1.0, 0
        self.renew()

    def renew(self) -> None:
        """Another case begins."""
        again = {"login": _YES} if self.logged_in else {}
        self.answers = {**REPLIES, "set_time": _YES, **again}
        self._open: Counter[str] = Counter()
        self._asked: dict[str, FrameSeen] = {}
        self._running: set[str] = set()
        self._list: list[bytes] = []  # the parts of the last one, and of one that is being told
        self._telling: list[bytes] = []
        self._part = 0

    @property
    def at_rest(self) -> bool:
        """Whether the client has been let in, and waits for nothing that it asked for."""
        return self.logged_in and not self._running and not any(self._open.values())

    def refused(self, name: str) -> FrameSeen | None:
        """The last request of a command, unless it was granted."""
        return self._asked.get(name)

    def taken(self, seen: FrameSeen) -> None:
        """A case has taken a request, and will answer it: what follows it waits its turn."""
        if seen.command and seen.command.initiator is A2C:  # else it was the answer to a chunk
            self._open[seen.name] += 1
        self._asked[seen.name] = seen
        self._at_instant = 0

    def sent(self, seen: FrameSeen) -> None:
        """Something was sent to the client: polls are told the same from now on."""
        name, data = seen.name, seen.frame.data
        if seen.frame.tagged:
            self._running.discard(name)
            self.answers["get_status"] = REPLIES["get_status"]
            return
        if name == _LIST:
            self._tell(data)
            return
        self._open[name] = max(self._open[name] - 1, 0)
        if name == "login":
            self.logged_in |= data == _YES
        if data == _YES and name in self._asked:
            self._set(self._asked.pop(name))
        if name in self.answers or name == "login":
            self.answers[name] = data
        elif seen.command and seen.command.two_stage and data == _YES:
            self._running.add(name)

    def _tell(self, part: bytes) -> None:
        """A part of a list was sent; where a case sent it, others are told the same list."""
        if not self._open[_LIST]:
            return
        self._telling.append(part)
        if not part.startswith(_MORE):  # what it asked before may have been for this (A-4.10-3)
            self._list, self._telling, self._part = self._telling, [], 0
            self._open[_LIST] = 0

    def _set(self, seen: FrameSeen) -> None:
        """A request was granted: what it set is told from now on."""
        if seen.name in _TELLS:
            self.answers[_TELLS[seen.name]] = seen.text
        elif seen.name == _SET_OUTPUT and seen.value:
            port, value = seen.value
            told = bytearray(self.answers[_OUTPUTS])
            if 1 <= port <= len(told) - len(_ANSWERED) and value in (0, 1):
                told[-port] = ord(f"{value}")
                self.answers[_OUTPUTS] = bytes(told)

    def next(self, heard: Iterable[FrameSeen], now_s: float) -> FrameSeen | None:
        """The first poll among requests that can be answered now."""
        if now_s != self._instant_s:
            self._instant_s, self._at_instant = now_s, 0
        if self._at_instant >= _AT_ONCE:
            return None
        served = self.answers.keys() & (self.answers.keys() if self.logged_in else {"login"})
        for seen in heard:
            if seen.name in served and not self._open[seen.name] and not self._due(seen):
                self._at_instant += 1
                self._asked[seen.name] = seen
                return seen
        return None

    def answer(
        self, poll: FrameSeen, programs: Mapping[bytes, bool], *, fetched: bool
    ) -> list[Frame]:
        """What a poll is told.

        Args:
            poll: What was asked.
            programs: What a list has, or has not, other than the document's own example.
            fetched: The client asks for each part of a list (A-4.10-3).
        """
        if poll.name != _LIST:
            return [Frame(C2A, poll.frame.opcode, self.answers[poll.name])]
        parts = [_listing(programs)] if programs or not self._list else self._list
        if fetched:
            parts = [parts[self._part % len(parts)]]
            self._part += 1
        return [Frame(C2A, poll.frame.opcode, part) for part in parts]


def _listing(programs: Mapping[bytes, bool]) -> bytes:
    flag, *example = REPLIES[_LIST].split(b"|")
    has = dict.fromkeys(example, True) | dict(programs)
    names = [name for name in has if has[name]]
    while len(data := b"|".join((flag, *names))) > MAX_DATA_BYTES:
        names.pop(0)
    return data
