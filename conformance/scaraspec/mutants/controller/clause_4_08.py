"""Mutants of clause 4.8: the status of the robot."""

from typing import Any, Final

from scaraspec.mutants.controller import Core, mutant, row
from scaraspec.mutants.operators.controller.replies import first_reply
from scaraspec.mutants.operators.controller.requests import answer_when, executing
from scaraspec.mutants.operators.controller.sampling import POSE, STATUS, sampling
from scaraspec.protocol.frames import Frame
from scaraspec.protocol.payloads import Acceptance, Outcome
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.robot import IDLE, MOVING, RUNNING
from scaraspec.virtual_controller.session import Request, Session

_WORDS: Final = {b"00": b"IDLE", b"05": b"ERROR", b"06": b"ERROR"}


def _during(command: str, status: str) -> Core:
    """The status during a command is replaced."""
    return answer_when("get_status", executing(command), status)


@mutant("transfers-are-motion", "4.8/3", subtle=True)
class MovesAfterTransfer(ControllerCore):
    """The status stays 04 on a connection that has transferred a file."""

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self._transferred: set[int] = set()

    def handle(self, session: Session, frame: Frame, now_s: float) -> None:
        super().handle(session, frame, now_s)
        if session.transfer is not None:
            self._transferred.add(session.connection)

    def get_status(self, request: Request) -> str:
        moves = request.session.connection in self._transferred
        return MOVING if moves else super().get_status(request)


def _runs_for_half_second(core: ControllerCore, request: Request) -> bool:
    task = core.robot.task
    return (
        task is not None
        and task.request.command.name == "run_program"
        and request.now_s - task.request.now_s > 0.5
    )


row(
    "status-of-one-digit",
    "4.8/2 4.8/3",
    "The status has one digit.",
    first_reply("get_status", lambda data: data[-1:]),
)
row(
    "status-in-words",
    "4.8/2",
    "The status is one of the three words of L214.",
    first_reply("get_status", lambda data: _WORDS.get(data, b"RUNNING")),
)
row(
    "status-in-binary",
    "4.8/2",
    "The status is one byte with the number.",
    first_reply("get_status", lambda data: bytes((int(data, 16),))),
)
row(
    "status-with-explanation",
    "4.8/2",
    "The status is followed by a word that explains it.",
    first_reply("get_status", lambda data: data + b"|" + _WORDS.get(data, b"RUNNING")),
)


@mutant("late-statuses-are-moving", "4.8/3", subtle=True)
class MovesLate(ControllerCore):
    """From the 90th to the 99th of every hundred requests, an idle robot reports 04."""

    _count = 0

    def get_status(self, request: Request) -> str:
        self._count += 1
        status = super().get_status(request)
        return MOVING if status == IDLE and self._count % 100 >= 90 else status


@mutant("idle-is-running-for-others", "4.8/3", subtle=True)
class RunsForOtherConnections(ControllerCore):
    """After a request for the version, every second connection reads the status 01 when idle."""

    _queried = False

    def get_version(self, request: Request) -> str:
        self._queried = True
        return super().get_version(request)

    def get_status(self, request: Request) -> str:
        status = super().get_status(request)
        is_other = request.session.connection % 2 == 0
        return RUNNING if status == IDLE and self._queried and is_other else status


@mutant("status-is-reserved", "4.8/3", "4.8/9")
class ReportsReservedStatus(ControllerCore):
    """The first status after a request for the version is 07."""

    _queried = False

    def get_version(self, request: Request) -> str:
        self._queried = True
        return super().get_version(request)

    def get_status(self, request: Request) -> str:
        queried, self._queried = self._queried, False
        return "07" if queried else super().get_status(request)


@mutant("missing-program-stays-in-the-status", "4.8/3", "4.8/9", subtle=True)
class ReportsMissingProgram(ControllerCore):
    """The first status after the refusal of a missing program is 20."""

    _missing = False

    def run_program(self, request: Request) -> Acceptance:
        reply = super().run_program(request)
        self._missing = reply.code == "20"
        return reply

    def get_status(self, request: Request) -> str:
        missing, self._missing = self._missing, False
        return "20" if missing else super().get_status(request)


@mutant("status-lags-behind-the-result", "4.8/3", subtle=True)
class RunsAfterResult(ControllerCore):
    """The status stays 01 for 5 s after the final result of a run or simulation."""

    _until_s = -1.0
    _now_s = 0.0

    def send_result(self, request: Request, outcome: Outcome) -> None:
        if request.command.name in ("run_program", "simulate_program"):
            self._until_s = self._now_s + 5.0
        super().send_result(request, outcome)

    def advance(self, now_s: float) -> list[Any]:
        self._now_s = now_s
        return super().advance(now_s)

    def get_status(self, request: Request) -> str:
        status = super().get_status(request)
        return RUNNING if status == IDLE and request.now_s < self._until_s else status


row(
    "running-is-idle",
    "4.8/4",
    "While a program runs, the status is 00.",
    _during("run_program", IDLE),
)
row(
    "running-is-moving",
    "4.8/4",
    "While a program runs, the status is 04.",
    _during("run_program", MOVING),
)
row(
    "running-is-idle-in-waits",
    "4.8/4",
    "The status is 00 when a program has run for more than half a second.",
    answer_when("get_status", _runs_for_half_second, IDLE),
    subtle=True,
)
row(
    "simulating-is-running",
    "4.8/5",
    "While a program is simulated, the status is 01.",
    _during("simulate_program", RUNNING),
)
row(
    "simulating-is-idle",
    "4.8/5",
    "While a program is simulated, the status is 00.",
    _during("simulate_program", IDLE),
)
row(
    "resetting-is-moving",
    "4.8/6",
    "During a reset the status is 04.",
    _during("reset", MOVING),
)
row(
    "resetting-is-idle",
    "4.8/6",
    "During a reset the status is 00.",
    _during("reset", IDLE),
)
row(
    "moving-is-running",
    "4.8/7",
    "During a move the status is 01.",
    _during("set_tool_coordinates", RUNNING),
)
row(
    "moving-is-idle",
    "4.8/7",
    "During a move the status is 00.",
    _during("set_tool_coordinates", IDLE),
)
row(
    "jogging-is-idle",
    "4.8/7",
    "During a jog the status is 00.",
    _during("jog", IDLE),
)
row(
    "jogging-is-running",
    "4.8/7",
    "During a jog the status is 01.",
    _during("jog", RUNNING),
)
row(
    "states-are-sampled-slowly",
    "4/8",
    "Status and pose are those of the last cycle of 300 ms.",
    sampling(0.3, *STATUS, *POSE),
    subtle=True,
)
