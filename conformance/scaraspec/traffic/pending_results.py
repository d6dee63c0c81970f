"""Executing: the two-stage commands of one connection, from their first reply to their result.

Lives here: which final result ends which command, and what proves that one has ended without. All
connections share one robot, so what executes is kept in the scene.
"""

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from typing import Final

from scaraspec.protocol.payloads import FinalResult
from scaraspec.traffic.events import Ending, Exchange, FrameSeen, InvalidBytes
from scaraspec.traffic.robot_state import RobotState

_MOST: Final = 16
_STOP: Final = "emergency_stop"


class PendingResults:
    """Follows the two-stage commands of one connection.

    Args:
        connection: Its name.
        robot: Shared by all connections.
    """

    def __init__(self, connection: str, robot: RobotState) -> None:
        self._connection = connection
        self._robot = robot
        self._late_replies_expected: Counter[str] = Counter()

    def _mine(self) -> list[Exchange]:
        return [x for x in self._robot.executing if x.request.place.connection == self._connection]

    def request_sent(self, exchange: Exchange) -> None:
        """A request was sent: note what executes at that time."""
        robot = self._robot
        exchange.state_version = robot.version
        if robot.executing:
            exchange.concurrent = tuple(x for x in robot.executing if not x.interrupted_by)
            exchange.concurrent_uncertain = robot.executing_uncertain
            if exchange.name == _STOP:
                for other in robot.executing:
                    other.stop_requested = True

    def reply_received(self, exchange: Exchange) -> None:
        """A first reply came: what executed at its request may have ended since."""
        robot = self._robot
        if exchange.concurrent:
            exchange.concurrent = tuple(x for x in exchange.concurrent if x in robot.executing)
        changed = exchange.state_version != robot.version
        unsettled = (
            exchange.name != _STOP and robot.executing_uncertain
        )  # it unsettles the others itself
        exchange.concurrent_uncertain = exchange.concurrent_uncertain or changed or unsettled
        if exchange.name == "get_status" and exchange.reply_value == "00" and exchange.certain:
            self._idle(exchange)

    def _idle(self, status: Exchange) -> None:
        """The robot says that nothing executes; the release of joints has no state (A-4-5)."""
        for x in status.concurrent:
            if x.name != "release_joints" and not x.stop_requested and not x.idle_status:
                x.idle_status = status.reply

    def accept(self, exchange: Exchange) -> Iterator[Exchange]:
        """A two-stage command executes from now on; give those that it proves to have ended.

        A stop proves nothing: it is accepted while others execute (A-4.17-1).
        """
        robot = self._robot
        for older in self._mine() if exchange.name != _STOP else ():
            if older.interrupted_by or older.idle_status or not older.certain:
                yield self._end(older, Ending.UNFINISHED if older.certain else Ending.UNSEEN)
        if len(robot.executing) >= _MOST:
            yield self._end(robot.executing[0], Ending.UNSEEN)
        # Snapshots, so that no chain of exchanges grows where commands overlap forever.
        executing = (x for x in exchange.concurrent if x in robot.executing)
        exchange.concurrent = tuple(replace(x, concurrent=()) for x in executing)
        if exchange.name in (_STOP, "jog"):  # a jog may replace another one (A-4.28-5)
            stop = replace(exchange, concurrent=())
            for older in robot.executing:
                if exchange.name == _STOP or older.name == "jog":
                    older.stop_requested, older.interrupted_by = True, stop
        robot.begin(exchange)

    def match(self, result: FrameSeen) -> Exchange | None:
        """Take out the command that this final result ends."""
        mine = [x for x in self._mine() if x.name == result.name]
        if not mine:
            return None
        exchange = min(mine, key=lambda x: x.interrupted_by is not None)
        exchange.result = result
        exchange.certain = exchange.certain and result.certain
        exchange.result_after_stop = not any(x.name == _STOP for x in self._robot.executing)
        self._robot.end(exchange)
        return exchange

    def match_malformed(self, found: InvalidBytes, opcode: int) -> Exchange | None:
        """Take out the command whose final result these bytes should have been."""
        for exchange in self._mine():
            if exchange.request.frame.opcode == opcode:
                exchange.malformed = found
                self._robot.end(exchange)
                return exchange
        return None

    def end_untagged(self, seen: FrameSeen) -> Iterator[Exchange]:
        """Give what has ended with a final result that lacks its tag: it executes no more."""
        if FinalResult().decode(seen.frame.data).value is not None:
            for exchange in self._mine():
                if exchange.name == seen.name:
                    yield self._end(exchange, Ending.UNSEEN)

    def abandon(self) -> None:
        """One side has hung up: what executes may be stopped for it (A-2-8)."""
        for exchange in self._mine():
            exchange.stop_requested = True

    def close(self, ending: Ending, idle_before_ns: int) -> Iterator[Exchange]:
        """Nothing more will be seen of them.

        Args:
            ending: How they ended, as far as is known.
            idle_before_ns: Where the robot had been idle by then, the result never came.
        """
        for exchange in self._mine():
            missing = exchange.idle_status and exchange.idle_status.place.time_ns < idle_before_ns
            yield self._end(exchange, Ending.UNFINISHED if missing else ending)

    def _end(self, exchange: Exchange, ending: Ending) -> Exchange:
        self._robot.end(exchange)
        self._late_replies_expected[exchange.name] += 1
        exchange.ending = ending
        return exchange

    def take_late_reply(self, name: str) -> bool:
        """Whether an unexpected final result may be one that was given up."""
        owed = self._late_replies_expected[name] > 0
        self._late_replies_expected[name] -= owed
        return owed
