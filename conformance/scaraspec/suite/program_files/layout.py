"""Program layout: how the subject's program files are laid out, found with programs that only wait.

Their aliases are empty and they wait for three seconds, so that a robot that reads them in another
layout meets nothing but zeros and the number 3, which as a type of node is a wait again: whatever
it makes of them, it does not move (A-6.1-2). What programs do is not judged here.
"""

from contextlib import suppress
from dataclasses import replace
from typing import Final

from scaraspec.protocol.program_files import LAYOUTS, Layout, Program
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.files import upload
from scaraspec.suite.controller.harness.requests.motion import IDLE, release_latch, status_of
from scaraspec.suite.controller.harness.traits import LayoutTrial
from scaraspec.suite.engine.expectations import CaseFailed, CaseInconclusive, NoReply
from scaraspec.suite.program_files.writing import EMPTY, layout_of, wait_program
from scaraspec.user_message import UserMessage

CODE_20: Final = "8/5"
"""What the judge may find of a file that is damaged, or that is right in another layout only."""

TRIAL_S: Final = 3
"""For how many of the subject's seconds a program waits by which its layout is found."""
_DAMAGED: Final = ("05", "20")  # A-4.15-2: what a file is refused with that is no program
_NS: Final = 1e9


def find_layout(subject: ControllerUnderTest, line: OutgoingConnection) -> Layout:
    """The layout in which the subject runs programs, found out once in a run.

    The layout that is claimed is tried first; the first that waits as it should is taken, else
    the first that comes to its end.

    Raises:
        CaseFailed: The subject runs a program in no layout (6.5/26).
        CaseInconclusive: It did not when it was asked before, or its state lets it run none.
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
    """How the program ran by which the layout was found, which waited for `TRIAL_S` seconds."""
    trial = subject.traits.layout_trial
    assert trial is not None, "`find_layout` was called before"
    return trial


def known_layout(subject: ControllerUnderTest) -> Layout | None:
    """The layout that was found, if one was."""
    return subject.traits.program_layout


def layout_in_use(subject: ControllerUnderTest) -> Layout:
    """The layout in which the subject was found to run or to list programs, or that it claims."""
    traits = subject.traits
    return traits.program_layout or traits.listed_layout or layout_of(subject.dialect)


def short_program(subject: ControllerUnderTest) -> bytes:
    """The file of a program that waits for a second."""
    return wait_program(subject.dialect, 1, layout=layout_in_use(subject))


def configured(subject: ControllerUnderTest, line: OutgoingConnection) -> Program:
    """A program whose configuration says what holds already (A-6.3-3).

    A run may make it hold, or refuse what cannot be; it is asked for once in a run.

    Raises:
        CaseInconclusive: It is nothing that a program can say.
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
                UserMessage("no program can carry what the subject tells: {error}", error=error)
            ) from None
    return traits.configured_program


def twin_of(layout: Layout) -> Layout | None:
    """The layout that differs from this one in nothing but the size of a long, if there is one."""
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
        took_s = trial.ended_s - trial.requested_s
        if took_s >= TRIAL_S / subject.ics.time_scale / 2:  # 6.5/20 is more exact
            return layout, trial
        ended = ended or (layout, trial)
    if ended is not None:
        return ended
    raise CaseFailed(
        "a program that only waits is run in none of the layouts that the structures can have",
        expected="1, and after its seconds 11",
        observed="a refusal or a failure in each",
        requirement="6.5/26",
    )


def candidates(subject: ControllerUnderTest) -> list[Layout]:
    """Every layout, the one first that is in use, and then those that are most like it."""
    likely = layout_in_use(subject)

    def strangeness(layout: Layout) -> tuple[bool, bool, bool]:
        return (
            layout != likely,
            layout.byte_order != likely.byte_order,
            layout.reading != likely.reading,
        )

    return sorted(LAYOUTS.values(), key=strangeness)


def _try(
    subject: ControllerUnderTest, line: OutgoingConnection, layout: Layout
) -> LayoutTrial | None:
    """How a waiting program of this layout runs; None where it does not end well.

    Where its result does not come that it has ended shows in the status, though not when: it may
    have been at once.
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
    try:
        result = line.result("run_program", within_s=TRIAL_S + subject.reply_s, untagged=True)
    except NoReply:
        if status_of(subject, line) == IDLE:
            return LayoutTrial(requested_s, answer.time_s, requested_s)
        if line.ask("emergency_stop").accepted:
            line.result("emergency_stop")
        return None
    return LayoutTrial(requested_s, answer.time_s, result.time_s) if result.done else None
