"""Poses that a client sends, and poses that it reports.

thetaY and thetaZ have no meaning on this series (L1006): a client may leave them at 0 (A-4.21-3).
No requirement is judged here.
"""

from collections.abc import Mapping
from typing import Any, Final

from scaraspec.protocol.commands import Pose
from scaraspec.suite.client.harness.call import Call
from scaraspec.suite.client.harness.client_under_test import ClientUnderTest
from scaraspec.suite.client.harness.driver_values import matches
from scaraspec.suite.client.harness.request_checks import is_near, numbers_in
from scaraspec.suite.engine.connection import ReceivedFrame
from scaraspec.suite.engine.expectations import expect, show_value
from scaraspec.user_message import UserMessage

MEANINGFUL: Final = ("x", "y", "z", "theta_x")
"""The values that have a meaning."""


def expect_pose(
    subject: ClientUnderTest,
    answer: ReceivedFrame,
    expected: Pose,
    *,
    speed: int | None = None,
) -> None:
    """Require that a request carries this pose, after the speed if there is one.

    Raises:
        CaseFailed: It carries something else.
    """
    leading = () if speed is None else (float(speed),)
    due_values = (*leading, *expected)
    sent = numbers_in(answer)
    meant = len(leading) + len(MEANINGFUL)
    expect(
        sent is not None
        and len(sent) == len(due_values)
        and all(map(is_near, sent[:meant], due_values))
        and all(
            is_near(number, due) or not number for number, due in zip(sent, due_values, strict=True)
        ),
        UserMessage("the request {command} carries wrong numbers", command=answer.seen.name),
        expected="|".join(f"{number:.15g}" for number in due_values),
        observed=show_value(answer.frame.data),
    )
    assert sent is not None
    if not all(map(is_near, sent, due_values)):
        message = "the client sends thetaY and thetaZ as 0 in every pose"
        subject.tolerate("7/2", "A-4.21-3", "0", message)


def expect_pose_reported(
    subject: ClientUnderTest, call: Call, due: Pose, *, requirement: str = ""
) -> None:
    """Require that the client reports this pose, with any thetaY and thetaZ.

    Raises:
        CaseFailed: It reports another pose, or none.
    """
    result = subject.expect_done(call, requirement=requirement)
    values = _by_name(result)
    right = all(matches(values.get(name), getattr(due, name)) for name in MEANINGFUL)
    useless = {name: values.get(name) or 0 for name in Pose._fields[len(MEANINGFUL) :]}
    expect(
        right
        and all(matches(v, 0) or matches(v, getattr(due, name)) for name, v in useless.items()),
        UserMessage("the client reports a wrong result of {call}", call=call.name),
        expected=f"{due._asdict()}",
        observed=f"{result}",
        requirement=requirement,
    )


def _by_name(result: Any) -> Mapping[str, Any]:
    if isinstance(result, Mapping):
        return result
    listed = result if isinstance(result, list) else []
    return dict(zip(Pose._fields, listed, strict=False))
