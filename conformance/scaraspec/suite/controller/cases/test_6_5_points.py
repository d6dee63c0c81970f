"""Clause 6.5: coordinate nodes and their moves (L904-942).

All moves are steps of one value from the current pose, and back.
"""

from itertools import product
from typing import Final

from scaraspec.judge.tolerances import turned
from scaraspec.suite.controller.harness.controller_under_test import ControllerUnderTest
from scaraspec.suite.controller.harness.outgoing_connection import OutgoingConnection
from scaraspec.suite.controller.harness.two_stage.arm import Arm, arm, near
from scaraspec.suite.engine.case import case
from scaraspec.suite.engine.examples import examples
from scaraspec.suite.engine.expectations import CaseInconclusive, expect
from scaraspec.suite.program_files.bench import PROGRAMS, bench
from scaraspec.suite.program_files.writing import Values, curve, straight
from scaraspec.user_message import UserMessage

_VALUES: Final = (3, 2, 1, 0)  # the last one only turns the gripper
_LEAST_SEEN: Final = 8
"""Minimum number of observed positions on a path for a statement about it."""
_MANY: Final = 20
"""Number of points of a straight move."""
_BEGUN_S: Final = 0.05
_GOES_ON_S: Final = 0.5
_ERROR_SEEN: Final = 3  # difference between observations of the same path


def _expect_at(moved: Arm, target: Values) -> None:
    place = moved.place()
    where = "0x3C" if moved.meaning == "joints" else "0x38"
    expect(
        near(place, target),
        UserMessage(
            "after a program, {source} does not report the values of its last point", source=where
        ),
        expected=f"{target}",
        observed=f"{place}",
    )


@case("6.5/27", hazards=PROGRAMS)
def test_point(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A program that ends with a coordinate node ends at its values."""
    with bench(subject, line) as robot, arm(subject, line, robot) as moved:
        done = []
        for index in _VALUES:
            for share in examples((1, -1)):  # a limit may be near
                target = moved.step(moved.home, index, share)
                back = [] if near(moved.place(), moved.home) else [moved.home]
                if moved.goes(straight(moved.speed_percent, [*back, target])):
                    _expect_at(moved, target)
                    done.append(index)
                    break
        if not done:
            raise CaseInconclusive("the arm cannot make the smallest step in any direction")


@case("6.5/27", name="curve", hazards=PROGRAMS, slow=True)
def test_curve(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A program whose last move is a curve of three or five points ends at its last point."""
    with bench(subject, line) as robot, arm(subject, line, robot) as moved:
        for share, lift in product((1, -1), repeat=2):  # a limit may be near
            corner = moved.step(moved.home, 0, share)
            last = moved.step(moved.home, 2, lift)
            points = [corner, moved.step(corner, 2, lift), last]
            if moved.goes(curve(moved.speed_percent, points)):
                _expect_at(moved, last)
                points = [points[1], corner, moved.home, corner, points[1]]
                if moved.goes(curve(moved.speed_percent, points)):
                    _expect_at(moved, points[-1])
                return
    raise CaseInconclusive("the arm cannot move along a small curve at its current pose")


@case("6.5/25", hazards=PROGRAMS)
def test_straight_move(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """A straight move passes all its points in order and ends at the last one."""
    with bench(subject, line) as robot, arm(subject, line, robot) as moved:
        home = moved.home
        up, down, last = (moved.step(home, 3), moved.step(home, 3, -1), moved.step(home, 3, 0.5))
        for speed_percent in (moved.speed_percent // 2, moved.slow_percent):
            seen = moved.watched(straight(max(1, speed_percent), [up, down, last]))
            if seen is None or len(seen) >= _LEAST_SEEN:
                break
        if seen is None:
            raise CaseInconclusive("the arm cannot turn slightly in both directions at its pose")
        place = moved.place()
        expect(
            near(place, last),
            "a straight move does not end at its last point",
            expected=f"{last}",
            observed=f"{place}",
        )
        if len(seen) < _LEAST_SEEN:  # too fast to observe; compare its duration
            third = moved.watched(straight(moved.slow_percent, [down])) or []
            expect(
                len(third) <= len(seen) + _ERROR_SEEN,
                "a straight move over three points takes less time than a third of it",
                expected=f"more than {len(third)} observations",
                observed=f"{len(seen)} observations",
            )
            return
        turns = [turned(values[3], home[3]) for values in seen]
        step = up[3] - home[3]
        peak = next((at for at, by in enumerate(turns) if by > step / 2), None)
        expect(
            peak is not None and min(turns[peak:], default=0) < -step / 2,
            "a straight move does not pass all its points",
            expected=f"beyond {step / 2:g}, then beyond {-step / 2:g}, then {step / 2:g}",
            observed=f"from {min(turns):g} to {max(turns):g}",
        )


@case("6.5/25", name="moves", hazards=PROGRAMS, slow=True)
def test_several_moves(subject: ControllerUnderTest, line: OutgoingConnection) -> None:
    """Points belong to the move before them: two moves of two points end at the fourth point.

    A move of many points ends at the last one. After an emergency stop on the way back, the arm
    does not move.
    """
    with bench(subject, line) as robot, arm(subject, line, robot) as moved:
        home, speed = moved.home, moved.speed_percent
        points = [moved.step(home, 3, share) for share in (1, 0.5, -0.5, -1)]
        if not moved.goes([*straight(speed, points[:2]), *straight(speed, points[2:])]):
            raise CaseInconclusive("the arm cannot turn slightly in both directions at its pose")
        place = moved.place()
        expect(
            near(place, points[-1]),
            "two straight moves do not end at the last point of the second one",
            expected=f"{points[-1]}",
            observed=f"{place}",
        )
        ways = [moved.step(home, 3, share) for share in (-0.2, 0.2)] * (_MANY // 2)
        moved.goes(straight(speed, [*ways, points[0]]))
        place = moved.place()
        expect(
            near(place, points[0]),
            UserMessage(
                "a straight move does not end at the last of {point_count} points",
                point_count=_MANY + 1,
            ),
            expected=f"{points[0]}",
            observed=f"{place}",
        )
        robot.start(straight(speed, points[-1:]))
        if robot.listens:
            _expect_standstill(line, moved)
        robot.stop()


def _expect_standstill(line: OutgoingConnection, moved: Arm) -> None:
    """Stop the program that moves the arm, and expect standstill."""
    line.wait(_BEGUN_S)
    if not line.ask("emergency_stop").accepted:
        return  # the move may be over
    line.result("emergency_stop")
    place = moved.place()
    line.wait(_GOES_ON_S)
    now = moved.place()
    expect(
        near(place, now),
        "the arm continues to move although its program was stopped",
        expected=f"{place}",
        observed=f"{now}",
        requirement="4.17/7",
    )
