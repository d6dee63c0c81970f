"""Lag: measures how much later than the state the replies report it (A-4.8-3).

The steps of the arm are those of the stop proof. `state_lag` defines which lags are tolerated.
"""

from collections.abc import Callable, Iterator
from typing import Final

from scaraspec.protocol.commands import Pose
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.requests.motion import (
    IDLE,
    SLOWEST_PERCENT,
    arm_returned,
    ask_move,
    begin_step_somewhere,
    pose_of,
    same_place,
)
from scaraspec.suite.controller.harness.state_lag import LONGEST_S, Lag, State
from scaraspec.suite.engine.deadline import Deadline

_MOVE: Final = "set_tool_coordinates"
_JUDGED: Final = ("4/7", "4/8", "4.8/7", "4.23/5", "4.24/8", "4.27/4")
"""The requirements that a lag seems to violate."""
_STEPS: Final = 4  # slow ones to observe the status, and fast ones to observe the pose
_STEPS_IF_LATE: Final = 8
_PHASE_S: Final = 0.013  # the steps end at different moments between two samples
_POLL_S: Final = 0.005
_RESULT_POLL_S: Final = 0.04
_ARRIVED_POLL_S: Final = 0.1  # the pose at the target seldom changes any more …
_ARRIVED_S: Final = 0.2  # … and not later: an arm was farther from its target that long ago
_NS: Final = 1e9


def measure(
    subject: ControllerUnderTest, line: OutgoingConnection, is_new: Callable[[], bool]
) -> Lag | None:
    """Measure how long a change is not reported that was made just now.

    Args:
        subject: The controller under test.
        line: A connection to it.
        is_new: Queries the state and returns whether the reply reports the change.

    Returns:
        The lag; None if there is none, or if the change is not reported at all.
    """
    changed_ns = subject.now_ns
    shown_s: float | None = None
    while True:
        age_s = (subject.now_ns - changed_ns) / _NS
        if is_new():
            return None if shown_s is None else Lag(shown_s, age_s)
        if age_s > LONGEST_S:
            return None
        shown_s = age_s
        line.wait(_POLL_S)


def probe_lag(subject: ControllerUnderTest) -> None:
    """Measure once how late the status and the pose of the tool follow steps of the arm.

    Raises:
        CaseFailed: The robot answers incorrectly.
        CaseInconclusive: The arm did not return to its start pose.
    """
    if subject.lag.steps_taken or _MOVE in subject.ics.unsupported:
        return
    line = subject.open()
    lags: list[tuple[State, Lag]] = []
    with subject.observer.ignoring(*_JUDGED), arm_returned(subject, line) as start:
        there, answer = begin_step_somewhere(subject, line, SLOWEST_PERCENT)
        target = there
        for number in range(_STEPS_IF_LATE):
            if not answer.accepted:
                break
            lags += _lags_of_step(subject, line, target)
            if number + 1 >= (_STEPS_IF_LATE if lags else _STEPS):
                break
            line.wait((number + 1) * _PHASE_S)
            back = number % 2 == 0
            target, speed_percent = (start, None) if back else (there, SLOWEST_PERCENT)
            answer = ask_move(subject, line, target, speed_percent)
    for state, lag in lags:
        subject.lag.note(state, lag)
    subject.lag.steps_taken = True
    if subject.lag.results_late:
        subject.observer.judge.results_are_late()
        subject.notify("final results come after the status is idle (A-4-9)")
    if State.STATUS not in subject.lag.measured:
        subject.observer.judge.status_is_current()


def _lags_of_step(
    subject: ControllerUnderTest, line: OutgoingConnection, target: Pose
) -> Iterator[tuple[State, Lag]]:
    """Yield the lags of the status at the begin of a step, and of the pose at its end."""
    begin = measure(subject, line, lambda: line.ask("get_status").value != IDLE)
    if begin and not any(seen.frame.tagged for seen in line.inbox):
        yield State.STATUS, begin
    if _is_idle_before_result(subject, line, target):
        subject.lag.results_late = True
    if end := _pose_lag(subject, line, target):
        yield State.POSE, end
    measure(subject, line, lambda: line.ask("get_status").value == IDLE)


def _is_idle_before_result(
    subject: ControllerUnderTest, line: OutgoingConnection, target: Pose
) -> bool:
    """Wait for the result of a step: whether status and pose showed its end clearly before."""
    idle, deadline = 0, Deadline(subject, subject.longest_s)
    while not deadline.expired:
        # A poll of the result would count as a late message.
        arrived = line.wait_for_any(_RESULT_POLL_S)
        if any(seen.frame.tagged for seen in line.inbox):
            line.result(_MOVE)
            return idle > 1
        if arrived:  # something else
            line.wait(_RESULT_POLL_S)
        idle += line.ask("get_status").value == IDLE and same_place(pose_of(line), target)
    line.result(_MOVE)
    return False


def _pose_lag(subject: ControllerUnderTest, line: OutgoingConnection, target: Pose) -> Lag | None:
    """Measure for how long the pose still changes after the end of a step; None if it does not.

    An arm that decelerates shows the last part of the lag only by the least digits of its pose. A
    pose that is at the target from the beginning is queried less often and for a shorter time.
    """
    ended_ns, poses = subject.now_ns, [(0.0, pose_of(line))]
    arrived = same_place(poses[0][1], target)
    poll_s, longest_s = (_ARRIVED_POLL_S, _ARRIVED_S) if arrived else (_POLL_S, LONGEST_S)
    while poses[-1][0] < longest_s:
        line.wait(poll_s)
        poses.append(((subject.now_ns - ended_ns) / _NS, pose_of(line)))
    line.wait(_POLL_S)
    last_s, last = poses[-1]
    late_s = [age_s for age_s, pose in poses if not same_place(pose, last)]
    if not late_s:
        return None
    changing_s = max(age_s for age_s, pose in poses if pose != last)
    return Lag(max(late_s), min((s for s, _ in poses if s > changing_s), default=last_s))
