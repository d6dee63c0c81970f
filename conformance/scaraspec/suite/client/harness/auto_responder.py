"""Automatic replies to polls: requests that a client sends without an operation.

A client may send more requests than the suite starts. A window that shows the status ten times a
second is an example. A poll is a request that no case waits for. Only queries, set_time (a client
may set the clock when it logs in) and a further login (A-4.1-2) are answered as polls.

After a case has answered a query, polls get the same reply. After a case has accepted a setting,
polls return the new value, because a client may read back what it has set. A program list contains
the programs of the pending operations, because a client may check the list before it uses one.
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
"""The reply to every query: the example of the document, with the missing bars added (A-0-1)."""

_QUERY_OF_SETTING: Final = {
    "set_network": "get_network",
    "set_time": "get_time",
    "set_default_program": "get_default_program",
    "set_gripper_center": "get_gripper_center",
    "set_initial_tool_position": "get_initial_tool_position",
}
"""Each setting, and the query that returns the value that was set."""

_SET_OUTPUT: Final = "set_digital_output"
_OUTPUTS: Final = "get_digital_outputs"
_SUCCESS_PREFIX: Final = b"1|"
_YES: Final = b"1"
_LIST: Final = "list_programs"
_MORE: Final = b"1"
_MAX_PER_INSTANT: Final = 16
"""How many polls are answered at one instant.

A client on a simulated clock could poll again at the same instant, without end.
"""


class AutoResponder:
    """The automatic replies on one connection.

    Args:
        is_expected: Returns whether a case waits for this request.

    Attributes:
        replies: The reply data to polls, by command name.
        logged_in: A login was accepted. Before that, only a login is answered (L104).
    """

    def __init__(self, is_expected: Callable[[FrameSeen], bool]) -> None:
        self._is_expected = is_expected
        self.logged_in = False
        self._instant_s, self._at_instant = -1.0, 0
        self.begin_case()

    def begin_case(self) -> None:
        """Reset the state for the next case."""
        further_login = {"login": _YES} if self.logged_in else {}
        self.replies = {**REPLIES, "set_time": _YES, **further_login}
        self._open: Counter[str] = Counter()
        self._requests: dict[str, FrameSeen] = {}
        self._running: set[str] = set()
        self._list: list[bytes] = []  # the parts of the last complete list
        self._list_in_progress: list[bytes] = []
        self._part = 0

    @property
    def idle(self) -> bool:
        """Whether the client is logged in and waits for no reply and no final result."""
        return self.logged_in and not self._running and not any(self._open.values())

    def last_request_not_granted(self, name: str) -> FrameSeen | None:
        """The last request of a command; None if it was granted."""
        return self._requests.get(name)

    def case_received(self, seen: FrameSeen) -> None:
        """Note a request that a case will answer. Later polls of the same command wait for that."""
        if seen.command and seen.command.initiator is A2C:  # otherwise it is the answer to a chunk
            self._open[seen.name] += 1
        self._requests[seen.name] = seen
        self._at_instant = 0

    def case_sent(self, seen: FrameSeen) -> None:
        """Note a frame that was sent to the client. Later polls get the same reply."""
        name, data = seen.name, seen.frame.data
        if seen.frame.tagged:
            self._running.discard(name)
            self.replies["get_status"] = REPLIES["get_status"]
            return
        if name == _LIST:
            self._note_list_part(data)
            return
        self._open[name] = max(self._open[name] - 1, 0)
        if name == "login":
            self.logged_in |= data == _YES
        if data == _YES and name in self._requests:
            self._note_setting(self._requests.pop(name))
        if name in self.replies or name == "login":
            self.replies[name] = data
        elif seen.command and seen.command.two_stage and data == _YES:
            self._running.add(name)

    def _note_list_part(self, part: bytes) -> None:
        """Note a part of a list. Polls get the same list after a case has sent it."""
        if not self._open[_LIST]:
            return
        self._list_in_progress.append(part)
        if not part.startswith(_MORE):  # earlier requests may have been for these parts (A-4.10-3)
            self._list, self._list_in_progress, self._part = self._list_in_progress, [], 0
            self._open[_LIST] = 0

    def _note_setting(self, seen: FrameSeen) -> None:
        """Note a setting that was accepted. Polls return the new value."""
        if seen.name in _QUERY_OF_SETTING:
            self.replies[_QUERY_OF_SETTING[seen.name]] = seen.text
        elif seen.name == _SET_OUTPUT and seen.value:
            port, value = seen.value
            outputs = bytearray(self.replies[_OUTPUTS])
            if 1 <= port <= len(outputs) - len(_SUCCESS_PREFIX) and value in (0, 1):
                outputs[-port] = ord(f"{value}")
                self.replies[_OUTPUTS] = bytes(outputs)

    def next_poll(self, requests: Iterable[FrameSeen], now_s: float) -> FrameSeen | None:
        """Return the first of the requests that is a poll and can be answered now."""
        if now_s != self._instant_s:
            self._instant_s, self._at_instant = now_s, 0
        if self._at_instant >= _MAX_PER_INSTANT:
            return None
        served = self.replies.keys() & (self.replies.keys() if self.logged_in else {"login"})
        for seen in requests:
            if seen.name in served and not self._open[seen.name] and not self._is_expected(seen):
                self._at_instant += 1
                self._requests[seen.name] = seen
                return seen
        return None

    def reply_frames(
        self, poll: FrameSeen, programs: Mapping[bytes, bool], *, fetched: bool
    ) -> list[Frame]:
        """Return the frames that answer a poll.

        Args:
            poll: The request.
            programs: Programs that a list contains (True) or must not contain (False), in
                addition to the example of the document.
            fetched: The client requests each part of a list (A-4.10-3).
        """
        if poll.name != _LIST:
            return [Frame(C2A, poll.frame.opcode, self.replies[poll.name])]
        parts = [_listing(programs)] if programs or not self._list else self._list
        if fetched:
            parts = [parts[self._part % len(parts)]]
            self._part += 1
        return [Frame(C2A, poll.frame.opcode, part) for part in parts]


def _listing(programs: Mapping[bytes, bool]) -> bytes:
    flag, *example = REPLIES[_LIST].split(b"|")
    present = dict.fromkeys(example, True) | dict(programs)
    names = [name for name in present if present[name]]
    while len(data := b"|".join((flag, *names))) > MAX_DATA_BYTES:
        names.pop(0)
    return data
