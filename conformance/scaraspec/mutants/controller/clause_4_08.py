"""Faults of clause 4.8: the status of the robot."""

from abc import ABC, abstractmethod
from typing import Any, Final

from scaraspec.mutants.controller import mutant
from scaraspec.mutants.operators.controller.replies import AltersReplies
from scaraspec.protocol.payloads import Acceptance, Outcome
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.robot import IDLE, MOVING, RUNNING
from scaraspec.virtual_controller.session import Request

_STATUS: Final = 0x09
_WORDS: Final = {b"00": b"IDLE", b"05": b"ERROR", b"06": b"ERROR"}
_LATE: Final = 90
_LAG_S: Final = 5.0
_HALF_S: Final = 0.5


@mutant("status-of-one-digit", "4.8/2", "4.8/3")
class StatusOfOneDigit(AltersReplies):
    """The status has one digit."""

    opcode = _STATUS

    def altered(self, data: bytes) -> bytes:
        """Leave the first digit away."""
        return data[-1:]


@mutant("transfers-are-motion", "4.8/3", subtle=True)
class TransfersAreMotion(ControllerCore):
    """Who sends or fetches a file is told that the robot moves."""

    def get_status(self, request: Request) -> str:
        """Tell him so."""
        return MOVING if request.session.transfer else super().get_status(request)


@mutant("status-in-words", "4.8/2")
class StatusInWords(AltersReplies):
    """The status is one of the three words of L214."""

    opcode = _STATUS

    def altered(self, data: bytes) -> bytes:
        """Say it in words."""
        return _WORDS.get(data, b"RUNNING")


@mutant("status-in-binary", "4.8/2")
class StatusInBinary(AltersReplies):
    """The status is a byte that is no digit."""

    opcode = _STATUS

    def altered(self, data: bytes) -> bytes:
        """Write the number."""
        return bytes((int(data, 16),))


@mutant("status-with-explanation", "4.8/2")
class StatusWithExplanation(AltersReplies):
    """Behind the status stands what it means."""

    opcode = _STATUS

    def altered(self, data: bytes) -> bytes:
        """Explain it."""
        return data + b"|" + _WORDS.get(data, b"RUNNING")


class _SaysOtherwise(ControllerCore, ABC):
    """The status is wrong while the robot is in one state."""

    @abstractmethod
    def wrong(self, status: str, request: Request) -> str:
        """What is said in place of a status."""

    def get_status(self, request: Request) -> str:
        """Say that."""
        return self.wrong(super().get_status(request), request)

    @property
    def executing(self) -> str:
        """The command that executes; empty where none does."""
        task = self.robot.task
        return task.request.command.name if task else ""


@mutant("late-statuses-are-moving", "4.8/3", subtle=True)
class LateStatusesAreMoving(_SaysOtherwise):
    """From the ninetieth request on a robot at rest is said to move."""

    _count = 0

    def wrong(self, status: str, request: Request) -> str:  # noqa: ARG002 - whoever asks
        """Count."""
        self._count += 1
        return MOVING if status == IDLE and self._count % 100 >= _LATE else status


@mutant("idle-is-running-for-others", "4.8/3", subtle=True)
class IdleIsRunningForOthers(_SaysOtherwise):
    """Once the version was asked for, every other connection is told that a program runs."""

    def wrong(self, status: str, request: Request) -> str:
        """Call it running."""
        odd = request.session.connection % 2
        return RUNNING if status == IDLE and self._asked > 0 and not odd else status

    _asked = 0

    def get_version(self, request: Request) -> str:
        """Once the version was asked for."""
        self._asked += 1
        return super().get_version(request)


@mutant("status-is-reserved", "4.8/3", "4.8/9")
class StatusIsReserved(_SaysOtherwise):
    """A robot at rest that was asked for its version says 07."""

    _asked = False

    def get_version(self, request: Request) -> str:
        """Remember it."""
        self._asked = True
        return super().get_version(request)

    def wrong(self, status: str, request: Request) -> str:  # noqa: ARG002 - whoever asks
        """Say it once."""
        asked, self._asked = self._asked, False
        return "07" if asked else status


@mutant("missing-program-stays-in-the-status", "4.8/3", "4.8/9", subtle=True)
class MissingProgramStaysInTheStatus(_SaysOtherwise):
    """A missing program is the next status."""

    _missing = False

    def run_program(self, request: Request) -> Acceptance:
        """Remember the refusal."""
        answer = super().run_program(request)
        self._missing = answer.code == "20"
        return answer

    def wrong(self, status: str, request: Request) -> str:  # noqa: ARG002 - whoever asks
        """Say it once."""
        missing, self._missing = self._missing, False
        return "20" if missing else status


@mutant("status-lags-behind-the-result", "4.8/3", subtle=True)
class StatusLagsBehindTheResult(_SaysOtherwise):
    """For some seconds behind the end of a program the status goes on as before."""

    _until_s = -1.0
    _now_s = 0.0
    _was = IDLE

    def send_result(self, request: Request, outcome: Outcome) -> None:
        """Keep the state."""
        if request.command.name in ("run_program", "simulate_program"):
            self._until_s, self._was = self._now_s + _LAG_S, RUNNING
        super().send_result(request, outcome)

    def advance(self, now_s: float) -> list[Any]:
        """Keep the time."""
        self._now_s = now_s
        return super().advance(now_s)

    def wrong(self, status: str, request: Request) -> str:
        """Look at the time."""
        return self._was if status == IDLE and request.now_s < self._until_s else status


def _in_place_of(name: str, said: str) -> Any:
    """How a status is wrong that is another one while a command executes."""

    def wrong(self: _SaysOtherwise, status: str, request: Request) -> str:  # noqa: ARG001 - whoever asks
        return said if self.executing == name else status

    return wrong


@mutant("running-is-idle", "4.8/4")
class RunningIsIdle(_SaysOtherwise):
    """While a program runs the status is 00."""

    wrong = _in_place_of("run_program", IDLE)


@mutant("running-is-moving", "4.8/4")
class RunningIsMoving(_SaysOtherwise):
    """While a program runs the status is 04."""

    wrong = _in_place_of("run_program", MOVING)


@mutant("running-is-idle-in-waits", "4.8/4", subtle=True)
class RunningIsIdleInWaits(_SaysOtherwise):
    """A program that has run for half a second is said to be at rest until something moves."""

    def wrong(self, status: str, request: Request) -> str:
        """Look at how long it runs."""
        task = self.robot.task
        late = task is not None and request.now_s - task.request.now_s > _HALF_S
        return IDLE if late and self.executing == "run_program" else status


@mutant("simulating-is-running", "4.8/5")
class SimulatingIsRunning(_SaysOtherwise):
    """While a program is simulated the status is 01."""

    wrong = _in_place_of("simulate_program", RUNNING)


@mutant("simulating-is-idle", "4.8/5")
class SimulatingIsIdle(_SaysOtherwise):
    """While a program is simulated the status is 00."""

    wrong = _in_place_of("simulate_program", IDLE)


@mutant("resetting-is-moving", "4.8/6")
class ResettingIsMoving(_SaysOtherwise):
    """While the robot resets the status is 04."""

    wrong = _in_place_of("reset", MOVING)


@mutant("resetting-is-idle", "4.8/6")
class ResettingIsIdle(_SaysOtherwise):
    """While the robot resets the status is 00."""

    wrong = _in_place_of("reset", IDLE)


@mutant("moving-is-running", "4.8/7")
class MovingIsRunning(_SaysOtherwise):
    """During a move the status is 01."""

    wrong = _in_place_of("set_tool_coordinates", RUNNING)


@mutant("moving-is-idle", "4.8/7")
class MovingIsIdle(_SaysOtherwise):
    """During a move the status is 00."""

    wrong = _in_place_of("set_tool_coordinates", IDLE)


@mutant("jogging-is-idle", "4.8/7")
class JoggingIsIdle(_SaysOtherwise):
    """During a jog the status is 00."""

    wrong = _in_place_of("jog", IDLE)


@mutant("jogging-is-running", "4.8/7")
class JoggingIsRunning(_SaysOtherwise):
    """During a jog the status is 01."""

    wrong = _in_place_of("jog", RUNNING)
