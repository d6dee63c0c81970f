"""The virtual arm: reach, and conversion between joint values and poses."""

import math
import operator

import pytest
from hypothesis import given
from hypothesis import strategies as st

from scaraspec.virtual_controller.arm import (
    HOME,
    INNER_REACH_MM,
    LOWER,
    UPPER,
    Joints,
    Offset,
    Pose,
    UnreachableError,
    clamp_to_limits,
    forward,
    gripper_point,
    inverse,
    within_limits,
)

JOINTS = st.builds(
    Joints,
    *(st.floats(low, high, allow_subnormal=False) for low, high in zip(LOWER, UPPER, strict=True)),
)
POSES = st.builds(
    Pose,
    st.floats(-450, 450),
    st.floats(-450, 450),
    st.floats(140, 360),
    st.floats(-700, 700),
)


@given(JOINTS)
def test_inverse_of_forward(joints: Joints) -> None:
    """The inverse returns the same joints, if the elbow is on the same side."""
    found = inverse(forward(joints), near=joints)
    # Near the stretched arm the cosine of the elbow angle is flat, so that a rounding error has a
    # large effect on the joints. At a limit the joint is moved onto it, which moves the position.
    at_limit = any(map(operator.contains, zip(LOWER, UPPER, strict=True), found))
    assert found == pytest.approx(joints, abs=1e-4)
    assert forward(found) == pytest.approx(forward(joints), abs=1e-4 if at_limit else 1e-6)


@given(POSES, JOINTS)
def test_inverse_respects_the_limits(pose: Pose, near: Joints) -> None:
    """The pose is refused, or the joints are within the limits and have this pose."""
    try:
        joints = inverse(pose, near)
    except UnreachableError:
        return
    assert within_limits(joints)
    assert forward(joints) == pytest.approx(pose, abs=0.01)
    assert joints.outer_arm_deg * near.outer_arm_deg >= 0


def test_the_stretched_arm_points_along_x() -> None:
    """Both arms at 0 reach 400 mm forward; a positive angle turns towards +Y (section 9)."""
    assert forward(Joints(0, 0, 200, 0)) == pytest.approx((400, 0, 200, 0))
    assert forward(Joints(90, 0, 200, 0)) == pytest.approx((0, 400, 200, 90))
    assert forward(Joints(0, 90, 200, -30)) == pytest.approx((200, 200, 200, 60))


def test_the_pose_of_the_document_is_reachable() -> None:
    """200|300|324 lies at radius 360.6 with an elbow of 51.3 degrees (section 9)."""
    pose = Pose(200, 300, 324, 34.6)
    joints = inverse(pose, near=inverse(HOME, near=UPPER))
    assert math.hypot(pose.x_mm, pose.y_mm) == pytest.approx(360.6, abs=0.05)
    assert joints.outer_arm_deg == pytest.approx(51.3, abs=0.05)
    assert forward(joints) == pytest.approx(pose)


@pytest.mark.parametrize(
    ("pose", "code"),
    [
        (Pose(400.1, 0, 250, 0), "05"),
        (Pose(1_000_000, 0, 250, 0), "05"),
        (Pose(1e308, 1e308, 250, 0), "05"),
        (Pose(INNER_REACH_MM - 0.1, 0, 250, 0), "05"),
        (Pose(0, 0, 250, 0), "05"),
        (Pose(300, 0, 149.9, 0), "05"),
        (Pose(300, 0, 350.1, 0), "05"),
        (Pose(math.nan, 0, 250, 0), "05"),
        (Pose(300, 0, math.nan, 0), "05"),
        (Pose(-300, 0, 250, 0), "06"),
        (Pose(300, 0, 250, 500), "06"),
        (Pose(300, 0, 250, math.nan), "06"),
    ],
)
def test_an_impossible_pose_is_refused_with_its_code(pose: Pose, code: str) -> None:
    """05 outside the annulus or Z, 06 beyond the limit of a joint (A-4.24-5)."""
    with pytest.raises(UnreachableError) as refusal:
        inverse(pose, near=UPPER)
    assert refusal.value.code == code


@pytest.mark.parametrize(
    ("joint", "code"),
    [("inner_arm_deg", "06"), ("outer_arm_deg", "06"), ("wrist_mm", "05"), ("rotation_deg", "06")],
)
@pytest.mark.parametrize(("limits", "outwards"), [(LOWER, -1), (UPPER, 1)])
def test_a_joint_may_be_at_its_limit(joint: str, code: str, limits: Joints, outwards: int) -> None:
    """The limit itself is valid; a value beyond it by less than the tolerance is set to the
    limit."""
    limit = getattr(limits, joint)
    assert within_limits(limits)
    assert clamp_to_limits(limits._replace(**{joint: limit + outwards * 0.0009})) == limits
    with pytest.raises(UnreachableError) as refusal:
        clamp_to_limits(limits._replace(**{joint: limit + outwards * 0.002}))
    assert refusal.value.code == code


@given(st.floats(LOWER.inner_arm_deg, UPPER.inner_arm_deg), st.sampled_from([0, -140, 140]))
def test_a_limit_shown_with_three_decimals_can_be_commanded(inner: float, outer: float) -> None:
    """A pose at the edge of the annulus is reachable after rounding."""
    edge = Joints(inner, outer, 350, 0)
    shown = Pose(*(round(value, 3) for value in forward(edge)))
    assert within_limits(inverse(shown, near=edge))


def test_the_elbow_stays_on_its_side() -> None:
    """Of the two elbow positions the nearer one is used; a stretched arm bends counter-
    clockwise."""
    left = inverse(HOME, near=Joints(0, 1, 250, 0))
    right = inverse(HOME, near=Joints(0, -1, 250, 0))
    assert left.outer_arm_deg == -right.outer_arm_deg > 0
    assert inverse(HOME, near=Joints(0, 0, 250, 0)) == left


def test_the_gripper_point_turns_with_the_tool() -> None:
    """The offset is fixed in the tool frame, which thetaX rotates (A-4.19-1)."""
    tool = Pose(300, 0, 250, 90)
    assert gripper_point(tool, Offset(10, 5, -40)) == pytest.approx((295, 10, 210, 90))
    assert gripper_point(tool, Offset(0, 0, 0)) == tool
