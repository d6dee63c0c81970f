"""Pending results: the two-stage commands of one connection, from first reply to final result.

This module decides which final result ends which command, and what proves that a command ended
without one. All connections share one robot, so `RobotState` has the executing commands.
"""

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from typing import Final

from scaraspec.protocol.payloads import FinalResult
from scaraspec.traffic.events import Ending, Exchange, FrameSeen, InvalidBytes
from scaraspec.traffic.robot_state import RobotState

_MAX_EXECUTING: Final = 16
_STOP: Final = "emergency_stop"


class PendingResults:
    """Follows the two-stage commands of one connection.

    Args:
        connection: The name of the connection.
        robot: The state of the robot, shared by all connections.
    """

    def __init__(self, connection: str, robot: RobotState) -> None:
        self._connection = connection
        self._robot = robot
        self._late_replies_expected: Counter[str] = Counter()

    def _own_commands(self) -> list[Exchange]:
        return [x for x in self._robot.executing if x.request.place.connection == self._connection]

    def request_sent(self, exchange: Exchange) -> None:
        """Store in a request which commands execute when it is sent."""
        robot = self._robot
        exchange.state_version = robot.version
        if robot.executing:
            exchange.concurrent = tuple(x for x in robot.executing if not x.interrupted_by)
            exchange.concurrent_uncertain = robot.executing_uncertain
            if exchange.name == _STOP:
                for other in robot.executing:
                    other.stop_requested = True

    def reply_received(self, exchange: Exchange) -> None:
        """Process a first reply: remove from `concurrent` what ended since the request."""
        robot = self._robot
        if exchange.concurrent:
            exchange.concurrent = tuple(x for x in exchange.concurrent if x in robot.executing)
        changed = exchange.state_version != robot.version
        uncertain = (
            exchange.name != _STOP and robot.executing_uncertain
        )  # a stop itself makes the others uncertain
        exchange.concurrent_uncertain = exchange.concurrent_uncertain or changed or uncertain
        if exchange.name == "get_status" and exchange.reply_value == "00" and exchange.certain:
            self._idle(exchange)

    def _idle(self, status: Exchange) -> None:
        """Process a status 00; the release of joints has no status of its own (A-4-5).

        A status shortly after the first reply may still be that from before it (A-4.8-3).
        """
        for x in status.concurrent:
            age_ns = status.time_ns - x.reply.place.time_ns if x.reply else 0
            if x.name == "release_joints" or x.stop_requested or x.idle_status:
                continue
            if age_ns >= self._robot.status_lag_ns:
                x.idle_status = status.reply
            elif status.request.place.connection == x.request.place.connection:
                x.lag_ns = max(x.lag_ns, age_ns)

    def accept(self, exchange: Exchange) -> Iterator[Exchange]:
        """Process an accepted two-stage command; yield the commands that have ended for certain.

        A stop does not show that others have ended: it is accepted while they execute (A-4.17-1).
        """
        robot = self._robot
        for older in self._own_commands() if exchange.name != _STOP else ():
            if older.interrupted_by or older.idle_status or not older.certain:
                yield self._end(older, Ending.UNFINISHED if older.certain else Ending.UNSEEN)
        if len(robot.executing) >= _MAX_EXECUTING:
            yield self._end(robot.executing[0], Ending.UNSEEN)
        # Copies: if commands overlap forever, no chain of exchanges may grow.
        executing = (x for x in exchange.concurrent if x in robot.executing)
        exchange.concurrent = tuple(replace(x, concurrent=()) for x in executing)
        if exchange.name in (_STOP, "jog"):  # a jog may replace another one (A-4.28-5)
            stop = replace(exchange, concurrent=())
            for older in robot.executing:
                if exchange.name == _STOP or older.name == "jog":
                    older.stop_requested, older.interrupted_by = True, stop
        robot.begin(exchange)

    def match(self, result: FrameSeen) -> Exchange | None:
        """Remove and return the command that this final result ends."""
        matching = [x for x in self._own_commands() if x.name == result.name]
        if not matching:
            return None
        exchange = min(matching, key=lambda x: x.interrupted_by is not None)
        exchange.result = result
        exchange.certain = exchange.certain and result.certain
        exchange.result_after_stop = not any(x.name == _STOP for x in self._robot.executing)
        self._robot.end(exchange)
        return exchange

    def match_malformed(self, invalid: InvalidBytes, opcode: int) -> Exchange | None:
        """Remove and return the command whose final result these bytes should have been."""
        for exchange in self._own_commands():
            if exchange.request.frame.opcode == opcode:
                exchange.malformed = invalid
                self._robot.end(exchange)
                return exchange
        return None

    def end_untagged(self, seen: FrameSeen) -> Iterator[Exchange]:
        """End the command whose final result arrived without its tag; yield it."""
        if FinalResult().decode(seen.frame.data).value is not None:
            for exchange in self._own_commands():
                if exchange.name == seen.name:
                    yield self._end(exchange, Ending.UNSEEN)

    def mark_stop_requested(self) -> None:
        """Process a hang-up: the controller may stop the executing commands (A-2-8)."""
        for exchange in self._own_commands():
            exchange.stop_requested = True

    def close(self, ending: Ending, idle_before_ns: int) -> Iterator[Exchange]:
        """End all commands: their final results cannot be observed any more.

        Args:
            ending: How they ended, as far as is known.
            idle_before_ns: If a status 00 came before this time, the result is missing.
        """
        for exchange in self._own_commands():
            missing = exchange.idle_status and exchange.idle_status.place.time_ns < idle_before_ns
            yield self._end(exchange, Ending.UNFINISHED if missing else ending)

    def _end(self, exchange: Exchange, ending: Ending) -> Exchange:
        self._robot.end(exchange)
        self._late_replies_expected[exchange.name] += 1
        exchange.ending = ending
        return exchange

    def take_late_reply(self, name: str) -> bool:
        """Whether an unsolicited final result may belong to a dropped command; counts once."""
        expected = self._late_replies_expected[name] > 0
        self._late_replies_expected[name] -= expected
        return expected
