"""Controllers that sample status, pose or inputs in a cyclic task (A-4.8-3)."""

from collections.abc import Callable
from typing import Any, Final

import pytest

from scaraspec.judge.verdicts import Verdict
from scaraspec.mutants.operators.controller.sampling import INPUTS, POSE, STATUS, sampling
from scaraspec.protocol.commands import Pose
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Request

RunCases = Callable[..., Any]

_CASES: Final = {
    STATUS: ("4/8", "4.8/6", "4.13/6", "4.26/3", "4.25/5"),
    POSE: ("4/8", "4.17/7", "4.24/8", "4.28/3"),
    INPUTS: ("4/8", "4.31/2", "6.6a/14"),
    (*STATUS, *POSE): ("4/8", "4.8/7", "4.17/7", "4.18/4"),
}
_IDS: Final = ("status", "pose", "inputs", "both")


@pytest.mark.parametrize("sampled", _CASES, ids=_IDS)
@pytest.mark.parametrize("period_s", [0.008, 0.05, 0.1])
def test_short_lag_is_tolerated(
    run_cases: RunCases, sampled: tuple[str, ...], period_s: float
) -> None:
    """A lag of at most 0.1 s fails no case; a lag that was observed is reported."""
    core = sampling(period_s, *sampled)
    cases = run_cases(core, *_CASES[sampled], hooks=("set_input",))
    assert not cases.problems
    if "status_lag" in cases.readings:
        (lag_s,) = cases.readings["status_lag"].options
        assert period_s / 2 <= float(lag_s) <= period_s + 0.005
        assert cases["4/8.lag"].verdict is Verdict.TOLERATED


@pytest.mark.parametrize("sampled", _CASES, ids=_IDS)
def test_long_lag_is_one_failure(run_cases: RunCases, sampled: tuple[str, ...]) -> None:
    """A longer lag fails one case, which reports the measured lag. No other case fails."""
    cases = run_cases(sampling(0.3, *sampled), *_CASES[sampled], hooks=("set_input",))
    (problem,) = cases.problems
    (lag_s,) = cases.readings["status_lag"].options
    assert problem.startswith("4/8.lag: ")
    assert f"{lag_s} s" in problem
    assert 0.2 < float(lag_s) <= 0.305


def test_other_controllers_have_no_lag(run_cases: RunCases) -> None:
    """A controller that reports its current state passes the case."""
    cases = run_cases(sampling(0.1), "4/8", hooks=("set_input",))
    assert cases["4/8.lag"].verdict is Verdict.PASS
    assert "status_lag" not in cases.readings


def test_pose_at_its_target_is_queried_seldom(run_cases: RunCases) -> None:
    """A robot without a lag is not asked for its pose a hundred times after each step."""
    queries: list[float] = []

    class Counts(ControllerCore):
        def get_tool_coordinates(self, request: Request) -> Pose:
            queries.append(request.now_s)
            return super().get_tool_coordinates(request)

    assert not run_cases(Counts, "4.15/2").problems
    assert 10 < len(queries) < 50
