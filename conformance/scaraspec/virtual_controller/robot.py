"""The robot: the command under execution, what the robot refuses during it, and its outcome.

It implements the states of table 8-1 (A-4-5). It handles no frames and knows no client except
through the request of its task.
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
"""The nearest code for a request with an unusable value (A-8-4)."""
RELEASED = "06"
"""The nearest code for released joints (A-4.25-1)."""

DONE = Outcome(done=True)
INTERRUPTED = Outcome(done=False, code=IDLE)
"""Outcome of a command that an emergency stop interrupts; no motor fault (A-4.17-4)."""


class Activity(Protocol):
    """An activity of the robot that ends with an outcome, such as a program run."""

    @property
    def next_event_s(self) -> float:
        """When to call `advance`; infinite if only an external change can end the wait."""

    def advance(self, now_s: float) -> Outcome | None:
        """Advance to `now_s`; return the outcome, or None if the activity continues."""


@dataclass(frozen=True, slots=True)
class Movement:
    """The activity that ends with the motion of the plant."""

    plant: Plant

    @property
    def next_event_s(self) -> float:
        """When the motion ends."""
        return self.plant.motion_ends_s

    def advance(self, now_s: float) -> Outcome | None:
        """Return `DONE` after the arm has arrived."""
        return DONE if now_s >= self.plant.motion_ends_s else None


@dataclass(frozen=True, slots=True)
class Task:
    """A two-stage command under execution.

    Attributes:
        request: The request that started it.
        state: The code that 0x09 reports during the task.
        activity: The activity in progress.
        program: The name of the program that it runs or simulates; otherwise empty.
        outcome_if_stopped: Its outcome if an emergency stop ends it.
        ends_with_link: Whether it ends with the connection that requested it (A-2-8).
    """

    request: Request
    state: str
    activity: Activity
    program: bytes = b""
    outcome_if_stopped: Outcome = INTERRUPTED
    ends_with_link: bool = False


class Robot:
    """A plant and its current task, if any."""

    def __init__(self, plant: Plant) -> None:
        self.plant = plant
        self.task: Task | None = None

    @property
    def status(self) -> str:
        """The code of 0x09: the fault, else the state of the task, else idle (A-4.8-2)."""
        return self.plant.fault_code or (self.task.state if self.task else IDLE)

    def refusal_code(self, *, moves: bool = True) -> str | None:
        """Return why a command cannot start: busy, fault or, if it moves, released (A-4-1)."""
        if self.task is not None:
            return self.task.state
        if self.plant.fault_code is not None:
            return self.plant.fault_code
        return RELEASED if moves and not self.plant.locked else None

    def move(self, request: Request, state: str, motion: Motion, *, jogging: bool = False) -> None:
        """Start a task that consists of one motion."""
        self.plant.start(motion, request.now_s)
        self.task = Task(
            request,
            state,
            Movement(self.plant),
            outcome_if_stopped=DONE if jogging else INTERRUPTED,  # a stop ends a jog (A-4.17-4)
            ends_with_link=jogging,
        )

    def stop(self, now_s: float) -> Task | None:
        """Stop at once and return the interrupted task, if any."""
        task, self.task = self.task, None
        if task is not None:
            self.plant.stop(now_s)
        return task

    def settle(self, now_s: float) -> tuple[Task, Outcome] | None:
        """Advance the task to `now_s`; return the task and its outcome if it has ended."""
        if self.task is None:
            return None
        task, fault = self.task, self.plant.fault_code
        outcome = Outcome(done=False, code=fault) if fault else task.activity.advance(now_s)
        if outcome is None:
            return None
        self.task = None
        return task, outcome
