"""Requests in any order: each request shows the effects of the earlier ones.

Each command is judged in its own clause. These cases find state that leaks, is kept too long or is
lost, and faults that appear only after many requests.
"""

from functools import partial
from random import Random
from typing import Final

from hypothesis import Phase, settings
from hypothesis import strategies as st

from scaraspec.protocol.hazard import Hazard
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.sequences import (
    StepDealer,
    attempt,
    new_model,
    operations_within,
    state_preserved,
)
from scaraspec.suite.controller.harness.two_stage.executing import skip_if_other_program_runs
from scaraspec.suite.engine.case import case
from scaraspec.suite.engine.deadline import Deadline
from scaraspec.suite.engine.examples import SHRINK_S, given
from scaraspec.suite.engine.shrink import shrink_sequence

_READ_ONLY: Final = (Hazard.READ_ONLY,)
_STATE: Final = (Hazard.STATE,)
_MOTION: Final = (Hazard.STATE, Hazard.MOTION)
_DESTRUCTIVE: Final = (Hazard.STATE, Hazard.DESTRUCTIVE)
_FILES: Final = (
    *("upload", "upload", "upload", "download", "delete", "list_programs", "abandon"),
    *("set_default", "set_default", "get_default", "set_clock", "query", "reconnect"),
    "send_in_parts",
)
_PASSWORDS: Final = (
    *("set_password", "mistake_password", "log_in", "log_in_wrongly", "reconnect"),
    *("set_password", "look", "upload", "download", "query"),
)
_PROGRAMS: Final = (
    *("upload", "delete", "run", "simulate", "stop", "look", "set_output", "get_outputs"),
    *("upload", "set_output"),
    *("upload", "interrupt", "interrupt", "set_output", "download", "set_centre", "get_poses"),
    *("set_initial", "set_clock", "abandon", "send_in_parts"),
    *("list_programs", "set_default", "get_default", "move", "query", "get_clock", "reconnect"),
    *("get_place", "jog", "release", "reset"),
)
_STEPS_PER_EXAMPLE: Final = 4  # of the longest sequence
_LONG_STEPS_PER_EXAMPLE: Final = 15


@case("3/31", "4.8/3", "4.9/6", name="sequences", hazards=_READ_ONLY)
def test_queries(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Queries and new connections in any order change nothing."""
    _run_in_any_order(subject, line, _READ_ONLY, share=8)


@case(
    *("5.2/12", "5.2/2", "5.2/3", "5.3/3", "4.10/11", "4.11/2", "4.11/3", "4.11/4"),
    *("4.13/2", "4.13/3", "3/31"),
    name="sequences",
    hazards=_STATE,
)
def test_files(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Files can be uploaded, downloaded, listed, deleted and set as default in any order."""
    _run_in_any_order(subject, line, _STATE, _FILES)


@case("4.20/3", "4.21/3", "4.5/4", "4.1/2", "4.1/3", "3/31", name="sequences", hazards=_STATE)
def test_settings(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Settings of positions and clock, and logins, work in any order, mixed with files."""
    _run_in_any_order(subject, line, _STATE)


@case(
    "4.2/4", "4.2/2", "4.2/3", "4.2/5", "4.1/2", name="sequences", hazards=_DESTRUCTIVE, slow=True
)
def test_passwords(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Password changes with correct and wrong old passwords work, mixed with other settings."""
    _run_in_any_order(subject, line, _DESTRUCTIVE, _PASSWORDS)


@case(
    *("4/15", "4/6", "4.8/3", "4.8/4", "4.8/5", "4.8/7", "4.9/2", "4.9/4", "4.9/6"),
    *("4.15/4", "4.15/7", "4.24/5", "4.24/6"),
    *("4.17/3", "4.32/4", "4.32/6", "4.24/8"),
    name="sequences",
    hazards=_MOTION,
)
def test_programs(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Runs, simulations, refusals and stops of programs work, mixed with outputs and settings."""
    _run_in_any_order(subject, line, _MOTION, _PROGRAMS, share=3)


def _run_in_any_order(
    subject: ControllerUnderTest,
    line: OutgoingConnection,
    hazards: tuple[Hazard, ...],
    only: tuple[str, ...] = (),
    *,
    share: int = 4,
) -> None:
    operations = operations_within(subject, frozenset(hazards), only)
    examples, dealer = settings().max_examples, StepDealer(operations)
    failed: dict[int, Exception] = {}
    with state_preserved(subject, line, operations) as scene:

        @settings(max_examples=-(-examples // share), phases=(Phase.generate,))
        @given(st.integers(0, 2**64))
        def run_steps(seed: int) -> None:
            steps = dealer.sequence(seed, _STEPS_PER_EXAMPLE * examples)
            if not failed and (failure := attempt(subject, operations, scene, steps)):
                retry = partial(attempt, subject, operations, scene, like=failure)
                deadline = Deadline(subject, SHRINK_S)
                shrunk = shrink_sequence(steps, failure, retry, lambda: not deadline.expired)
                failed[seed] = shrunk.error
            if error := failed.get(seed):  # hypothesis calls it twice
                raise error

        with skip_if_other_program_runs(subject):
            run_steps()


@case("3/31", "5.2/12", "4.10/11", name="long-use", hazards=_STATE)
def test_long_use(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Hundreds of requests of every kind on the same connections have the right effects."""
    operations = [
        operation
        for operation in operations_within(subject, frozenset(_STATE))
        if operation not in ("reconnect", "abandon")
    ]
    count = settings().max_examples * _LONG_STEPS_PER_EXAMPLE
    dealer, random = StepDealer(operations), Random(0)  # noqa: S311 - it must be reproducible
    with (
        skip_if_other_program_runs(subject),
        state_preserved(subject, line, operations) as scene,
        new_model(subject, operations, scene) as model,
    ):
        for _ in range(count):
            model.perform(dealer.step(random))
