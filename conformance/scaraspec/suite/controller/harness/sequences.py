"""Sequences: requests in any order, each compared with all requests before it.

Sequences are dealt at random, but in such a way that every step occurs in every run, and in every
variant. A `Model` of the subject performs them step by step. Any step may be omitted, so a failing
sequence can be shrunk to the few steps that cause the failure.
"""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from random import Random
from typing import Final, NamedTuple

from scaraspec.protocol.commands import Point, Pose
from scaraspec.protocol.hazard import Hazard
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.model.model import Model
from scaraspec.suite.controller.harness.model.state import SEEDS, VALUES, Scene, Step
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.motion import (
    ask_move,
    in_box,
    pose_of,
    release_latch,
    stop_motion,
    wait_for_end,
)
from scaraspec.suite.controller.harness.state.password import restore_password
from scaraspec.suite.controller.harness.state.preserve import password_preserved, settings_preserved
from scaraspec.suite.controller.harness.two_stage.commands import (
    JOG,
    LOCK,
    MOVE,
    RELEASE,
    RESET,
    RUN,
    SIMULATE,
    STOP,
)
from scaraspec.suite.controller.harness.two_stage.tasks import probe_responsiveness
from scaraspec.suite.engine.expectations import CaseFailed, CaseInconclusive
from scaraspec.suite.engine.shrink import Failure
from scaraspec.suite.program_files.listed import long_name

_ZERO: Final = Point(0, 0, 0)
_SLOW_EVERY, _FIRST_SLOW = 160, 60  # of the steps whose requests are cut
_LONG_NAME: Final = 30  # bytes, the maximum that every controller accepts (A-5-20)


class _Act(NamedTuple):
    """A kind of step: the hazards that must be allowed, and the commands that it uses."""

    hazards: frozenset[Hazard]
    commands: tuple[str, ...] = ()


_READ_ONLY: Final[frozenset[Hazard]] = frozenset()
_STATE: Final = frozenset({Hazard.STATE})
_DESTRUCTIVE: Final = _STATE | {Hazard.DESTRUCTIVE}
_MOTION: Final = _STATE | {Hazard.MOTION}
_ACTS: Final[Mapping[str, _Act]] = {
    "look": _Act(_READ_ONLY, ("get_running_program",)),
    "query": _Act(_READ_ONLY),
    "reconnect": _Act(_READ_ONLY),
    "send_in_parts": _Act(_READ_ONLY),
    "log_in": _Act(_STATE),
    "log_in_wrongly": _Act(_STATE),
    "upload": _Act(_STATE),
    "download": _Act(_STATE),
    "delete": _Act(_STATE),
    "abandon": _Act(_STATE),
    "list_programs": _Act(_STATE, ("list_programs",)),
    "set_default": _Act(_STATE, ("get_default_program", "set_default_program")),
    "get_default": _Act(_STATE, ("get_default_program", "set_default_program")),
    "set_centre": _Act(_STATE, ("get_gripper_center", "set_gripper_center")),
    "set_initial": _Act(_STATE, ("get_initial_tool_position", "set_initial_tool_position")),
    "get_poses": _Act(_STATE, ("get_gripper_center", "get_initial_tool_position")),
    "mistake_setting": _Act(_STATE),
    "set_clock": _Act(_STATE, ("get_time", "set_time")),
    "get_clock": _Act(_READ_ONLY, ("get_time",)),
    "set_password": _Act(_DESTRUCTIVE, ("set_password",)),
    "mistake_password": _Act(_DESTRUCTIVE, ("set_password",)),
    "set_output": _Act(_MOTION, ("get_digital_outputs", "set_digital_output")),
    "get_outputs": _Act(_MOTION, ("get_digital_outputs", "set_digital_output")),
    "run": _Act(_MOTION, (RUN, STOP)),
    "simulate": _Act(_MOTION, (SIMULATE, STOP)),
    "interrupt": _Act(_MOTION, (RUN, SIMULATE, STOP)),
    "move": _Act(_MOTION, (MOVE, "get_gripper_center", "set_gripper_center")),
    "get_place": _Act(_MOTION, (MOVE, "get_gripper_center", "set_gripper_center")),
    "jog": _Act(_MOTION, (JOG, STOP)),
    "release": _Act(_MOTION, (RELEASE, LOCK)),
    "reset": _Act(_MOTION, (RESET, "get_initial_tool_position", "set_initial_tool_position")),
    "stop": _Act(_MOTION, (STOP,)),
}


def operations_within(
    subject: ControllerUnderTest, hazards: frozenset[Hazard], only: Sequence[str] = ()
) -> list[str]:
    """Return the steps that are possible with these hazards, or those of them in `only`.

    A name that occurs several times in `only` is drawn more often.
    """
    unsupported = subject.ics.unsupported
    return [
        name
        for name in only or _ACTS
        if _ACTS[name].hazards <= hazards and unsupported.isdisjoint(_ACTS[name].commands)
    ]


class StepDealer:
    """Deals steps like cards: each one occurs before any occurs again.

    Args:
        acts: The names of the steps. A name that occurs several times is dealt more often.
    """

    def __init__(self, acts: list[str]) -> None:
        self._acts = acts
        self._deck: list[str] = []
        self._turns = Counter[str]()
        self._cut_steps = 0
        self._dealt: dict[int, list[Step]] = {}

    def sequence(self, seed: int, longest: int) -> list[Step]:
        """Return the sequence of a seed, of at most so many steps; always the same one."""
        if seed not in self._dealt:
            random = Random(seed)  # noqa: S311 - it must be reproducible
            count = random.randint(1, longest)
            self._dealt[seed] = [self.step(random) for _ in range(count)]
        return self._dealt[seed]

    def step(self, random: Random) -> Step:
        """Return the next step."""
        if not self._deck:
            self._deck = random.sample(self._acts, len(self._acts))
        act = self._deck.pop()
        self._turns[act] += 1
        which, value, line = (random.randrange(VALUES) for _ in range(3))
        step = Step(act, which, value, line, random.randrange(SEEDS), self._turns[act] - 1)
        self._cut_steps += bool(step.cuts)
        return step._replace(slow=bool(step.cuts) and self._cut_steps % _SLOW_EVERY == _FIRST_SLOW)


@contextmanager
def state_preserved(
    subject: ControllerUnderTest, line: OutgoingConnection, acts: list[str]
) -> Iterator[Scene]:
    """Restore everything that these steps may change when the context ends.

    The connection is closed, because sequences open their own.

    Yields:
        What the sequences have in common.
    """
    hazards = frozenset[Hazard]().union(*(_ACTS[act].hazards for act in acts))
    with ExitStack() as stack:
        if Hazard.STATE in hazards:
            items = ("default program", "gripper centre", "initial tool position", "clock")
            stack.enter_context(settings_preserved(subject, line, *items))
        if Hazard.MOTION in hazards:
            probe_responsiveness(subject, line)
            stack.enter_context(settings_preserved(subject, line, "outputs"))
        home = _home(subject, line) if "move" in acts else None
        if Hazard.DESTRUCTIVE in hazards and subject.access.needs_login:
            stack.enter_context(password_preserved(subject))
        line.close()
        scene = Scene(_names(subject), home)
        stack.callback(_go_home, subject, scene)
        yield scene


def _names(subject: ControllerUnderTest) -> list[bytes]:
    """Return names of every shape: similar, short, long, capital, with digits and other bytes."""
    name = subject.new_name()
    stem, _, extension = name.rpartition(b".")
    return [
        name,
        stem + b"x." + extension,
        long_name(subject, _LONG_NAME),
        long_name(subject, _LONG_NAME),
        subject.new_name(lead="Z"),
        subject.new_name("-_.Z"),
        subject.new_name("0099"),
        subject.new_name("a b"),
    ]


def _go_home(subject: ControllerUnderTest, scene: Scene) -> None:
    """Move the arm to its start pose if a sequence has moved it."""
    if scene.home is None or scene.place == scene.home:
        return
    with suppress(CaseFailed, CaseInconclusive):
        line = subject.open()
        stop_motion(subject, line)
        if line.ask("set_gripper_center", _ZERO).accepted:
            ask_move(subject, line, scene.home)
            wait_for_end(subject, line, MOVE)


def _home(subject: ControllerUnderTest, line: OutgoingConnection) -> Pose | None:
    """Return the pose of the arm for a gripper center of zero; None if it must not move there."""
    release_latch(subject, line)
    if not line.ask("set_gripper_center", _ZERO).accepted:
        return None
    pose = pose_of(line)
    return pose if in_box(subject, pose) else None


@contextmanager
def new_model(subject: ControllerUnderTest, acts: list[str], scene: Scene) -> Iterator[Model]:
    """Yield a new model without files. Check the final state and clean up when the context ends.

    Raises:
        CaseFailed: The final state of the controller differs from the model.
    """
    if "set_password" in acts:
        for _ in range(2):
            with suppress(
                CaseFailed, CaseInconclusive
            ):  # a model that failed may have left another
                restore_password(subject)
    model = Model(subject, acts, scene)
    try:
        yield model
        model.check()
    finally:
        with suppress(CaseFailed, CaseInconclusive):
            model.clean_up()


def attempt(
    subject: ControllerUnderTest,
    acts: list[str],
    scene: Scene,
    steps: Sequence[Step],
    like: Failure | None = None,
) -> Failure | None:
    """Perform all steps of a sequence.

    Returns:
        How it fails; None if it passes, or if it violates another requirement than `like`.
    """
    performed = 0
    try:
        with new_model(subject, acts, scene) as model:
            for step in steps:
                performed += 1
                model.perform(step)
    except CaseFailed as error:
        if like is None or error.requirement == like.error.requirement:
            return Failure(error, performed)
    return None
