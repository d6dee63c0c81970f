"""Sequences: requests in any order, each compared with all requests before it.

Sequences are drawn at random. A `Model` of the subject performs them step by step. Any step may be
omitted, so a failing sequence can be shrunk to the few steps that cause the failure.
"""

import itertools
import random
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from typing import Final, NamedTuple

from hypothesis import strategies as st

from scaraspec.protocol.hazard import Hazard
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.model.model import Model
from scaraspec.suite.controller.harness.model.state import SEEDS, VALUES, Step
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.state.password import restore_password
from scaraspec.suite.controller.harness.state.preserve import password_preserved, settings_preserved
from scaraspec.suite.controller.harness.two_stage.commands import MOVE, RUN, SIMULATE, STOP
from scaraspec.suite.controller.harness.two_stage.tasks import probe_responsiveness
from scaraspec.suite.engine.expectations import CaseFailed, CaseInconclusive
from scaraspec.suite.engine.shrink import Failure
from scaraspec.suite.program_files.listed import long_name

_NAMES: Final = 3
_LONG_NAME: Final = 30  # bytes, the maximum that every controller accepts (A-5-20)
_GROUP: Final = 10


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
    "log_in": _Act(_STATE),
    "log_in_wrongly": _Act(_STATE),
    "upload": _Act(_STATE),
    "download": _Act(_STATE),
    "delete": _Act(_STATE),
    "list_programs": _Act(_STATE, ("list_programs",)),
    "set_default": _Act(_STATE, ("get_default_program", "set_default_program")),
    "get_default": _Act(_STATE, ("get_default_program", "set_default_program")),
    "set_centre": _Act(_STATE, ("get_gripper_center", "set_gripper_center")),
    "set_initial": _Act(_STATE, ("get_initial_tool_position", "set_initial_tool_position")),
    "get_poses": _Act(_STATE, ("get_gripper_center", "get_initial_tool_position")),
    "set_clock": _Act(_STATE, ("get_time", "set_time")),
    "get_clock": _Act(_READ_ONLY, ("get_time",)),
    "set_password": _Act(_DESTRUCTIVE, ("set_password",)),
    "mistake_password": _Act(_DESTRUCTIVE, ("set_password",)),
    "set_output": _Act(_MOTION, ("get_digital_outputs", "set_digital_output")),
    "get_outputs": _Act(_MOTION, ("get_digital_outputs", "set_digital_output")),
    "run": _Act(_MOTION, (RUN, STOP)),
    "simulate": _Act(_MOTION, (SIMULATE, STOP)),
    "interrupt": _Act(_MOTION, (RUN, SIMULATE, STOP)),
    "move": _Act(_MOTION, (MOVE,)),
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


def sequences(acts: list[str], groups: int) -> st.SearchStrategy[list[Step]]:
    """Return a strategy for sequences of these steps. More groups allow longer sequences."""
    number, seed = st.integers(0, VALUES - 1), st.integers(0, SEEDS - 1)
    group = st.lists(
        st.builds(Step, st.sampled_from(acts), number, number, number, seed), max_size=_GROUP
    )
    return st.lists(group, min_size=1, max_size=groups).map(
        lambda groups: list(itertools.chain.from_iterable(groups))
    )


def endless_sequence(acts: list[str]) -> Iterator[Step]:
    """Yield a reproducible sequence without end."""
    drawn = random.Random(0)  # noqa: S311 - it must be reproducible
    while True:
        which, value, line = (drawn.randrange(VALUES) for _ in range(3))
        yield Step(drawn.choice(acts), which, value, line, drawn.randrange(SEEDS))


@contextmanager
def state_preserved(
    subject: ControllerUnderTest, line: OutgoingConnection, hazards: frozenset[Hazard]
) -> Iterator[list[bytes]]:
    """Restore everything that sequences may change when the context ends.

    The connection is closed, because sequences open their own.

    Yields:
        The names that sequences may give to files.
    """
    with ExitStack() as stack:
        if Hazard.STATE in hazards:
            items = ("default program", "gripper centre", "initial tool position", "clock")
            stack.enter_context(settings_preserved(subject, line, *items))
        if Hazard.MOTION in hazards:
            probe_responsiveness(subject, line)
            stack.enter_context(settings_preserved(subject, line, "outputs"))
        if Hazard.DESTRUCTIVE in hazards and subject.access.needs_login:
            stack.enter_context(password_preserved(subject))
        names = [subject.new_name() for _ in range(_NAMES)]
        names += [long_name(subject, _LONG_NAME), subject.new_name("-_.Z")]
        line.close()
        yield names


@contextmanager
def new_model(
    subject: ControllerUnderTest, acts: list[str], names: Sequence[bytes]
) -> Iterator[Model]:
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
    model = Model(subject, acts, names)
    try:
        yield model
        model.check()
    finally:
        with suppress(CaseFailed, CaseInconclusive):
            model.clean_up()


def attempt(
    subject: ControllerUnderTest,
    acts: list[str],
    names: Sequence[bytes],
    steps: Sequence[Step],
    like: Failure | None = None,
) -> Failure | None:
    """Perform all steps of a sequence.

    Returns:
        How it fails; None if it passes, or if it violates another requirement than `like`.
    """
    performed = 0
    try:
        with new_model(subject, acts, names) as model:
            for step in steps:
                performed += 1
                model.perform(step)
    except CaseFailed as error:
        if like is None or error.requirement == like.error.requirement:
            return Failure(error, performed)
    return None
