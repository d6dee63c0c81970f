"""Program layout: determines the layout of program files with programs that only wait.

The programs have empty aliases and wait for three seconds. A robot that reads them in another
layout finds only zeros and the number 3, which as a node type is also a wait. So the robot does not
move in any case (A-6.1-2). This module does not judge what programs do.
"""

from contextlib import suppress
from dataclasses import replace
from typing import Final

from scaraspec.protocol.errors import BUSY
from scaraspec.protocol.program_files import LAYOUTS, Layout, Program
from scaraspec.suite.controller.harness.controller_under_test import (
    SILENCE_S,
    ControllerUnderTest,
)
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.files import upload
from scaraspec.suite.controller.harness.requests.motion import (
    IDLE,
    is_responsive,
    release_latch,
    status_of,
)
from scaraspec.suite.controller.harness.timeouts import ExpectedReply
from scaraspec.suite.controller.harness.traits import LayoutTrial
from scaraspec.suite.engine.connection import ReceivedFrame
from scaraspec.suite.engine.deadline import Deadline
from scaraspec.suite.engine.expectations import CaseFailed, CaseInconclusive, NoReply
from scaraspec.suite.program_files.writing import EMPTY, layout_of, wait_program
from scaraspec.user_message import UserMessage

CODE_20: Final = "8/5"
"""The finding of the judge about a file that is damaged, or valid only in another layout."""

TRIAL_S: Final = 3
"""How long the programs wait, in seconds of the subject's clock."""
_DAMAGED: Final = ("05", "20")  # the codes for a file that is no valid program (A-4.15-2)
_SLICE_S: Final = 0.5
"""The time between two status queries, in seconds of the subject's clock."""
_NS: Final = 1e9


def find_layout(subject: ControllerUnderTest, line: OutgoingConnection) -> Layout:
    """Return the layout in which the subject runs programs; determined once per run.

    The claimed layout is tried first. The result is the first layout whose program waits correctly,
    or else the first whose program ends successfully.

    Raises:
        CaseFailed: The subject runs a program in no layout (6.5/26).
        CaseInconclusive: An earlier case has failed for this reason, or the subject cannot run
            programs in its current state.
    """
    traits = subject.traits
    if not traits.program_layout_tried:
        release_latch(subject, line)
        with subject.observer.ignoring(CODE_20):
            try:
                layout, traits.layout_trial = _find(subject, line)
            except CaseFailed:
                traits.program_layout_tried = True
                raise
        traits.program_layout, traits.program_layout_tried = layout, True
        subject.set_reading("prog_layout", layout.reading)
    if traits.program_layout is None:
        raise CaseInconclusive("the subject runs programs in no layout of the document")
    return traits.program_layout


def trial_of(subject: ControllerUnderTest) -> LayoutTrial:
    """Return when the program ran that determined the layout. It waited for `TRIAL_S` seconds."""
    trial = subject.traits.layout_trial
    assert trial is not None, "`find_layout` was called before"
    return trial


def known_layout(subject: ControllerUnderTest) -> Layout | None:
    """Return the layout in which the subject runs programs; None if it is unknown."""
    return subject.traits.program_layout


def layout_in_use(subject: ControllerUnderTest) -> Layout:
    """Return the layout in which the subject runs programs, or else lists them, or else claims."""
    traits = subject.traits
    return traits.program_layout or traits.listed_layout or layout_of(subject.dialect)


def short_program(subject: ControllerUnderTest) -> bytes:
    """Return the file of a program that waits for a second."""
    return wait_program(subject.dialect, 1, layout=layout_in_use(subject))


def configured(subject: ControllerUnderTest, line: OutgoingConnection) -> Program:
    """Return an empty program whose configuration equals that of the robot (A-6.3-3).

    A program may set its configuration, or be refused because of it. The configuration is read once
    per run.

    Raises:
        CaseInconclusive: A program cannot contain the reported values.
    """
    traits = subject.traits
    if traits.configured_program is None:
        tool, center = EMPTY.tool_position, EMPTY.tool_center
        with suppress(NoReply):
            tool = tuple(line.ask("get_initial_tool_position").value or tool)
            center = tuple(line.ask("get_gripper_center").value or center)
        try:
            traits.configured_program = replace(EMPTY, tool_position=tool, tool_center=center)
        except ValueError as error:
            raise CaseInconclusive(
                UserMessage("a program cannot contain the reported values: {error}", error=error)
            ) from None
    return traits.configured_program


def twin_of(layout: Layout) -> Layout | None:
    """Return the layout that differs only in the size of a long; None if there is none."""
    return next(
        (
            other
            for other in LAYOUTS.values()
            if replace(other, name=layout.name, long_bytes=layout.long_bytes) == layout != other
        ),
        None,
    )


def _find(subject: ControllerUnderTest, line: OutgoingConnection) -> tuple[Layout, LayoutTrial]:
    ended: tuple[Layout, LayoutTrial] | None = None
    for layout in candidates(subject):
        trial = _try(subject, line, layout)
        if trial is None:
            continue
        if _waited(subject, trial.requested_s, trial.ended_s):
            return layout, trial
        shows_end = trial.ended_s > trial.requested_s or is_responsive(subject, line)
        if not shows_end:  # no other layout would show more
            return layout, trial
        ended = ended or (layout, trial)
    if ended is not None:
        return ended
    raise CaseFailed(
        "a program that only waits does not run in any layout of the structures",
        expected="1, and 11 after the wait",
        observed="a refusal or a failure in each",
        requirement="6.5/26",
    )


def _waited(subject: ControllerUnderTest, requested_s: float, ended_s: float) -> bool:
    """Whether a program that ended then has executed its wait; 6.5/20 is more exact."""
    return ended_s - requested_s >= TRIAL_S / subject.ics.time_scale / 2


def candidates(subject: ControllerUnderTest) -> list[Layout]:
    """Return every layout: first the one in use, then the most similar ones."""
    likely = layout_in_use(subject)

    def difference(layout: Layout) -> tuple[bool, bool, bool]:
        return (
            layout != likely,
            layout.byte_order != likely.byte_order,
            layout.reading != likely.reading,
        )

    return sorted(LAYOUTS.values(), key=difference)


def _try(
    subject: ControllerUnderTest, line: OutgoingConnection, layout: Layout
) -> LayoutTrial | None:
    """Run a waiting program of this layout.

    Returns:
        When it ran; None if it does not end successfully. If the final result is missing, an idle
        status shows that the program has ended. It ended after the last status that shows that it
        runs; without one, it may have ended at once.
    """
    name = subject.new_name()
    base = configured(subject, line)
    upload(line, name, wait_program(subject.dialect, TRIAL_S, layout=layout, base=base))
    subject.moved = True
    requested_s = subject.now_ns / _NS
    answer = line.ask("run_program", name)
    if not answer.accepted:
        if answer.code is not None and answer.code not in _DAMAGED:
            raise CaseInconclusive(
                UserMessage("the subject cannot run programs now: {answer}", answer=answer)
            )
        return None
    result, ran_until_s = _watch(subject, line, requested_s)
    if result is not None:
        return LayoutTrial(requested_s, answer.time_s, result.time_s) if result.done else None
    if status_of(subject, line) == IDLE:
        subject.timeout_policy.note_timeout(ExpectedReply("run_program", result=True))
        return LayoutTrial(requested_s, answer.time_s, ran_until_s)
    if line.ask("emergency_stop").accepted:
        line.result("emergency_stop")
    return None


def _watch(
    subject: ControllerUnderTest, line: OutgoingConnection, requested_s: float
) -> tuple[ReceivedFrame | None, float]:
    """Wait for the end of a program.

    Without a result, two idle statuses show it: after the program was seen to run for a plausible
    time, or when it must have ended.

    Returns:
        The final result, or None if it is missing; and when the status last showed that the program
        runs, or when it was requested.
    """
    trial_s, slice_s = (each / subject.ics.time_scale for each in (TRIAL_S, _SLICE_S))
    deadline, ran_until_s = Deadline(subject, trial_s + subject.reply_s), requested_s
    status: str | None = None
    while not (deadline.expired or line.ended):
        with suppress(NoReply):
            within_s = min(slice_s, deadline.remaining_s)
            return line.result("run_program", within_s=within_s, untagged=True), ran_until_s
        if not is_responsive(subject, line):
            continue
        before, status = status, status_of(subject, line)
        if status in BUSY:
            ran_until_s = subject.now_ns / _NS
        elif before == status == IDLE and (
            _waited(subject, requested_s, ran_until_s)
            or subject.now_ns / _NS > requested_s + trial_s + slice_s
        ):
            break
    with suppress(NoReply):
        return line.result("run_program", within_s=SILENCE_S, untagged=True), ran_until_s
    return None, ran_until_s
