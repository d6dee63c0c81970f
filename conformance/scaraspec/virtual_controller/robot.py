"""The robot: which command it is executing, what it refuses meanwhile, and how that ends.

The states of table 8-1 (A-4-5) live here. Frames and clients do not, but for whose task it is.
"""

from dataclasses import dataclass
from typing import Protocol

from scaraspec.protocol.payloads import Outcome
from scaraspec.virtual_controller.motion import Motion
from scaraspec.virtual_controller.plant import Plant
from scaraspec.virtual_controller.session import Request

IDLE = "00"
RUNNING = "01"
SIMULATING = "02"
RESETTING = "03"
MOVING = "04"
BAD_ARGUMENT = "05"
"""The nearest code for a request that says nothing usable (A-8-4)."""
RELEASED = "06"
"""The nearest code for joints that do not hold (A-4.25-1)."""

DONE = Outcome(done=True)
INTERRUPTED = Outcome(done=False, code=IDLE)
"""Of what an emergency stop interrupts: no motor is to blame (A-4.17-4)."""


class Activity(Protocol):
    """Something that goes on until it has an outcome, such as a run of a program."""

    @property
    def next_event_s(self) -> float:
        """When `advance` has something to do; infinite if nothing is due."""

    def advance(self, now_s: float) -> Outcome | None:
        """Do what is due, and return the outcome once there is one."""


@dataclass(frozen=True, slots=True)
class Movement:
    """The act of waiting for the plant's motion to end."""

    plant: Plant

    @property
    def next_event_s(self) -> float:
        """When the motion ends."""
        return self.plant.motion_ends_s

    def advance(self, now_s: float) -> Outcome | None:
        """Done as soon as the arm has arrived."""
        return DONE if now_s >= self.plant.motion_ends_s else None


@dataclass(frozen=True, slots=True)
class Task:
    """A two-stage command under execution.

    Attributes:
        request: Who asked for it, and when.
        state: The code that 0x09 reports meanwhile.
        act: What goes on.
        program: The name of the program it runs or simulates; empty for others.
        stopped: Its outcome if an emergency stop ends it.
        needs_link: Whether it ends with the connection that asked for it (A-2-8).
    """

    request: Request
    state: str
    activity: Activity
    program: bytes = b""
    outcome_if_stopped: Outcome = INTERRUPTED
    ends_with_link: bool = False


class Robot:
    """A plant and the one task it has, if any."""

    def __init__(self, plant: Plant) -> None:
        self.plant = plant
        self.task: Task | None = None

    @property
    def status(self) -> str:
        """The code of 0x09: a fault before a task before idle (A-4.8-2)."""
        return self.plant.fault_code or (self.task.state if self.task else IDLE)

    def refusal_code(self, *, moves: bool = True) -> str | None:
        """Why a command cannot start now: busy, at fault or, if it moves, released (A-4-1)."""
        if self.task is not None:
            return self.task.state
        if self.plant.fault_code is not None:
            return self.plant.fault_code
        return RELEASED if moves and not self.plant.locked else None

    def move(self, request: Request, state: str, motion: Motion, *, jogging: bool = False) -> None:
        """Begin a task that is one motion."""
        self.plant.start(motion, request.now_s)
        outcome_if_stopped = (
            DONE if jogging else INTERRUPTED
        )  # a jog ends by being stopped (A-4.17-4)
        self.task = Task(
            request, state, Movement(self.plant), b"", outcome_if_stopped, ends_with_link=jogging
        )

    def stop(self, now_s: float) -> Task | None:
        """Stop everything at once; the task that this interrupts, if there is one."""
        task, self.task = self.task, None
        if task is not None:
            self.plant.stop(now_s)
        return task

    def settle(self, now_s: float) -> tuple[Task, Outcome] | None:
        """Let the task go on until now; the task and its outcome if it has ended."""
        if self.task is None:
            return None
        task, fault = self.task, self.plant.fault_code
        outcome = Outcome(done=False, code=fault) if fault else task.activity.advance(now_s)
        if outcome is None:
            return None
        self.task = None
        return task, outcome
