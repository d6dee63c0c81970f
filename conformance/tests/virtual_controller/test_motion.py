"""Motions are continuous, within the limits, and through their points."""

import math
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from scaraspec.protocol.payloads import JogDirection
from scaraspec.virtual_controller.arm import (
    HOME,
    INNER_REACH_MM,
    LOWER,
    OUTER_REACH_MM,
    UPPER,
    Joints,
    Pose,
    UnreachableError,
    forward,
    inverse,
    within_limits,
)
from scaraspec.virtual_controller.motion import (
    JOG_SPEED_MM_S,
    JOINT_SPEEDS,
    RAMP_S,
    TOOL_SPEED_MM_S,
    Motion,
    curve,
    hold,
    jog,
    move,
    straight_line,
)

START = inverse(HOME, near=UPPER)
JOINTS = st.builds(Joints, *(st.floats(a, b) for a, b in zip(LOWER, UPPER, strict=True)))
LEFT_ELBOW = JOINTS.filter(lambda joints: joints.outer_arm_deg > 1)
SPEEDS = st.integers(1, 100)


def reach(x_mm: float, y_mm: float, z_mm: float = 250, theta_x_deg: float = 0) -> Joints:
    return inverse(Pose(x_mm, y_mm, z_mm, theta_x_deg), near=UPPER)


def check_motion(motion: Motion, start: Joints, end: Joints, share_of_speed: float = 1.0) -> None:
    """Check start, end, limits, and the speed of every joint."""
    assert motion.joints_at(-1) == motion.joints_at(0) == pytest.approx(start)
    assert motion.joints_at(motion.duration_s) == motion.joints_at(1e9) == end
    steps = 100
    step_s = motion.duration_s / steps
    samples = [motion.joints_at(step * step_s) for step in range(steps + 1)]
    assert all(map(within_limits, samples))
    for before, after in pairwise(samples):
        for p, q, speed in zip(before, after, JOINT_SPEEDS, strict=True):
            assert abs(q - p) <= speed * share_of_speed * step_s * 1.0001 + 1e-9


@given(JOINTS, JOINTS, SPEEDS)
def test_a_move_is_valid(start: Joints, target: Joints, speed_percent: int) -> None:
    """Between any two positions, within the limits and the commanded share of every joint's
    speed."""
    motion = move(start, target, speed_percent)
    check_motion(motion, start, target, speed_percent / 100)


@given(LEFT_ELBOW, LEFT_ELBOW, SPEEDS)
def test_a_straight_line_is_valid_or_refused(start: Joints, end: Joints, percent: int) -> None:
    """A planned line stays within the limits and its speed; otherwise the whole line is refused."""
    try:
        motion = straight_line(start, end, percent)
    except UnreachableError:
        return
    check_motion(motion, start, end, percent / 100)
    a, b = forward(start), forward(end)
    for step in range(21):
        pose = forward(motion.joints_at(motion.duration_s * step / 20))
        detour = math.dist(a[:3], pose[:3]) + math.dist(pose[:3], b[:3]) - math.dist(a[:3], b[:3])
        assert detour < 1


@given(st.lists(LEFT_ELBOW, min_size=3, max_size=6), SPEEDS)
def test_a_curve_is_valid_or_refused(targets: list[Joints], percent: int) -> None:
    """A planned curve stays within the limits and its speed; otherwise the whole curve is
    refused."""
    try:
        motion = curve(START, targets, percent)
    except UnreachableError:
        return
    check_motion(motion, START, targets[-1], percent / 100)


def test_a_move_starts_and_ends_smoothly() -> None:
    """The speed increases from 0 and decreases to 0, with at most the acceleration of the ramp."""
    motion = move(START, START._replace(inner_arm_deg=START.inner_arm_deg + 90), 100)
    step_s = motion.duration_s / 1000
    angles = [motion.joints_at(step * step_s).inner_arm_deg for step in range(1001)]
    speeds = [(b - a) / step_s for a, b in pairwise(angles)]
    jumps = [abs(b - a) / step_s for a, b in pairwise(speeds)]
    assert speeds[0] < 1 > speeds[-1]
    assert max(speeds) == pytest.approx(JOINT_SPEEDS.inner_arm_deg, rel=1e-3)
    assert max(jumps) <= JOINT_SPEEDS.inner_arm_deg / RAMP_S


def test_a_typical_move_takes_about_a_second() -> None:
    """Half a second to two at full speed; twice as long at half speed."""
    target = reach(200, 300, 324, 34.6)
    motion = move(START, target, 100)
    assert 0.5 < motion.duration_s < 2
    assert move(START, target, 50).duration_s == pytest.approx(2 * motion.duration_s)


def test_a_straight_line_is_straight_and_turns_evenly() -> None:
    """The deviation is below 0.1 mm; thetaX changes in proportion to the distance; the tool speed
    is limited."""
    start, end = reach(250, -200, 200, -40), reach(250, 200, 300, 80)
    motion = straight_line(start, end, 100)
    assert motion.duration_s >= math.dist((250, -200, 200), (250, 200, 300)) / TOOL_SPEED_MM_S
    for step in range(1, 100):
        pose = forward(motion.joints_at(motion.duration_s * step / 100))
        way = (pose.y_mm + 200) / 400
        assert pose.x_mm == pytest.approx(250, abs=0.1)
        assert pose.z_mm == pytest.approx(200 + 100 * way, abs=0.1)
        assert pose.theta_x_deg == pytest.approx(-40 + 120 * way, abs=0.1)


def test_a_line_out_of_reach_between_reachable_ends_is_refused() -> None:
    """The arm may neither cross the hole of the annulus nor change the elbow side."""
    with pytest.raises(UnreachableError) as hole:
        straight_line(reach(-200, 150), reach(200, -150), 100)
    assert hole.value.code == "05"
    other_elbow = inverse(HOME, near=LOWER)
    with pytest.raises(UnreachableError) as elbow:
        straight_line(START, other_elbow, 100)
    assert elbow.value.code == "06"


def test_a_line_may_begin_stretched_with_either_elbow() -> None:
    """A stretched arm has no elbow side: the line uses the side of its other end."""
    stretched = Joints(0, 0, 250, 0)
    for near in (UPPER, LOWER):
        end = inverse(HOME, near)
        check_motion(straight_line(stretched, end, 100), stretched, end)


def test_a_curve_passes_its_points_without_corners() -> None:
    """Every target is reached, and the direction changes little between two samples."""
    targets = [reach(320, 100), reach(250, 200), reach(180, 180), reach(200, 50)]
    motion = curve(START, targets, 50)
    samples = [forward(motion.joints_at(motion.duration_s * i / 2000)) for i in range(2001)]
    for target in targets:
        point = forward(target)
        assert min(math.dist(point[:3], pose[:3]) for pose in samples) < 0.5
    middle = samples[100:-100:20]
    headings = [math.atan2(b.y_mm - a.y_mm, b.x_mm - a.x_mm) for a, b in pairwise(middle)]
    turns = [math.remainder(b - a, math.tau) for a, b in pairwise(headings)]
    assert max(map(abs, turns)) < math.radians(20)


@pytest.mark.parametrize(
    ("direction", "x_sign", "y_sign"),
    [
        (JogDirection.PLUS_X, 1, 0),
        (JogDirection.MINUS_X, -1, 0),
        (JogDirection.PLUS_Y, 0, 1),
        (JogDirection.MINUS_Y, 0, -1),
    ],
)
def test_a_jog_follows_its_axis_to_the_limit(
    direction: JogDirection, x_sign: int, y_sign: int
) -> None:
    """20 mm/s along one base axis, without other changes, until the arm reaches a limit."""
    motion = jog(START, direction)
    check_motion(motion, START, motion.waypoints[-1])
    pose = forward(motion.joints_at(1.0))
    travel_mm = JOG_SPEED_MM_S * 1.0
    expected = HOME._replace(x_mm=300 + x_sign * travel_mm, y_mm=y_sign * travel_mm)
    assert pose == pytest.approx(expected, abs=0.1)
    end = forward(motion.waypoints[-1])
    assert end.theta_x_deg == pytest.approx(0, abs=0.01)
    beyond = end._replace(x_mm=end.x_mm + x_sign * 0.01, y_mm=end.y_mm + y_sign * 0.01)
    with pytest.raises(UnreachableError):
        inverse(beyond, near=START)


def test_a_jog_at_the_limit_is_over_at_once() -> None:
    """If the arm cannot move further, the jog has duration 0."""
    edge = jog(START, JogDirection.PLUS_X).waypoints[-1]
    assert jog(edge, JogDirection.PLUS_X).duration_s == pytest.approx(0, abs=1e-3)
    assert math.hypot(*forward(edge)[:2]) == pytest.approx(OUTER_REACH_MM, abs=0.01)
    inner = jog(START, JogDirection.MINUS_X).waypoints[-1]
    assert math.hypot(*forward(inner)[:2]) == pytest.approx(INNER_REACH_MM, abs=0.01)


@given(JOINTS, st.sampled_from(JogDirection))
def test_a_jog_from_anywhere_is_valid(start: Joints, direction: JogDirection) -> None:
    """It starts at the current position and never leaves the limits."""
    motion = jog(start, direction)
    check_motion(motion, start, motion.waypoints[-1])


def test_holding_is_not_a_motion() -> None:
    """The arm stays at one position, and the duration is 0."""
    assert hold(START).duration_s == 0
    assert {hold(START).joints_at(t_s) for t_s in (-1.0, 0.0, 7.0)} == {START}


def test_a_move_to_the_current_position_takes_no_time() -> None:
    """A distance of 0 causes no division by zero."""
    for motion in (move(START, START, 10), straight_line(START, START, 10)):
        assert motion.duration_s < 0.01
        assert motion.joints_at(0.0) == pytest.approx(START)


@pytest.mark.parametrize("speed_percent", [0, -1, 101, math.nan])
def test_a_speed_outside_1_to_100_percent_is_refused(speed_percent: float) -> None:
    """The caller must refuse such a request (A-4.24-4)."""
    with pytest.raises(ValueError, match="1 to 100 percent"):
        move(START, START, speed_percent)
