"""Timeouts: a missing reply fails its own requirement, and is waited for in full only twice."""

from collections.abc import Callable
from typing import Any

import pytest

from scaraspec.judge.requirements import select
from scaraspec.judge.verdicts import Verdict
from scaraspec.mutants.controller import mutants
from scaraspec.protocol.commands import BY_NAME
from scaraspec.protocol.frames import Frame
from scaraspec.suite.controller.harness.timeouts import ExpectedReply, TimeoutPolicy
from scaraspec.virtual_controller.core import ControllerCore
from scaraspec.virtual_controller.session import Session

RunCases = Callable[..., Any]

_FULL_S = 60.0


def requirement_ids(clauses: str) -> list[str]:
    """Return the requirements of some clauses."""
    return [requirement.id for requirement in select(clauses)]


def without_reply(name: str) -> type[ControllerCore]:
    """Return a controller that never answers one command."""

    class Mute(ControllerCore):
        def handle(self, session: Session, frame: Frame, now_s: float) -> None:
            if frame.opcode != BY_NAME[name].opcode:
                super().handle(session, frame, now_s)

    return Mute


@pytest.mark.parametrize(
    "due", [ExpectedReply("get_version"), ExpectedReply("run_program", result=True)]
)
def test_missing_reply_is_waited_for_in_full_twice(due: ExpectedReply) -> None:
    """After a reply has arrived once, its full timeout is always used."""
    policy = TimeoutPolicy()
    for _ in range(2):
        assert policy.timeout_s(due, _FULL_S) == _FULL_S
        policy.note_timeout(due)
    assert policy.timeout_s(due, _FULL_S) < _FULL_S
    assert policy.timeout_s(due, 0.1) == 0.1
    policy.note_received(due)
    assert policy.timeout_s(due, _FULL_S) == _FULL_S
    policy.note_timeout(due)
    policy.note_timeout(due)
    assert not policy.given_up(due)


def test_standstill_is_waited_for_in_full_twice() -> None:
    """After the robot came to rest late, the full timeout is used again."""
    policy = TimeoutPolicy()
    policy.note_rest(_FULL_S, rests=False)
    policy.note_rest(0.1, rests=True)
    assert policy.rest_timeout_s(_FULL_S) == _FULL_S
    policy.note_rest(_FULL_S, rests=False)
    assert policy.rest_timeout_s(_FULL_S) < _FULL_S
    policy.note_rest(20.0, rests=True)
    assert policy.rest_timeout_s(_FULL_S) == _FULL_S


def test_unanswered_query_fails_only_its_requirements(run_cases: RunCases) -> None:
    """Other cases skip a query after it was missed twice."""
    cases = run_cases(
        without_reply("get_motor_temperatures"),
        *requirement_ids("2,3/24,4.14,4.20/3,4/15,T"),
        examples=20,
    )
    assert cases.violated <= {"2/5", "2/6", "3/31", "4.14/2", "4.14/3"}
    assert "3/31" in cases.violated
    assert {cases[name].verdict for name in ("2/6", "3/24", "T/1")} == {Verdict.PASS}
    assert sum(case.duration_s for case in cases.values()) < 200


def test_unanswered_deletion_does_not_fail_cleanup(run_cases: RunCases) -> None:
    """A missing reply to a deletion during cleanup does not fail the case."""
    cases = run_cases(
        without_reply("delete_program"), *requirement_ids("5.1,5.2/2,5.2/3,5.2/14,5.2/16")
    )
    assert {"3/31"} <= cases.violated <= {"3/31", "4.11/3"}
    assert {cases[name].verdict for name in ("5.1/1", "5.1/8", "5.2/3.elsewhere")} == {Verdict.PASS}


def test_missing_result_of_a_move_fails_only_its_requirements(run_cases: RunCases) -> None:
    """Other cases detect the end of a move by the status."""
    cases = run_cases(mutants()["move-has-no-result"].wrong, *requirement_ids("4.8,4.15,4.23,4.24"))
    assert cases.violated == {"3/18", "4.24/6"}
    assert sum(case.duration_s for case in cases.values()) < 500


def test_untagged_result_is_not_a_later_reply(run_cases: RunCases) -> None:
    """An untagged result is not treated as the refusal of a later command."""
    cases = run_cases(mutants()["forgets-the-tag"].wrong, "3/12", "3/18", "4.15/4", "4.15/5")
    assert {"3/12", "4.15/5"} <= cases.violated
    assert not [case for case in cases.values() if "refused by a robot" in case.message]


def test_untagged_results_do_not_fail_program_cases(run_cases: RunCases) -> None:
    """After results were missed, other cases accept an untagged result as the end of a program."""
    cases = run_cases(
        mutants()["run-ends-untagged"].wrong, "4.15/5", *requirement_ids("6.4/5,6.5,6.6a")
    )
    assert cases["4.15/5"].verdict is Verdict.FAIL
    assert cases.violated == {"3/12", "4.15/5"}


def test_program_is_stopped_despite_idle_status(run_cases: RunCases) -> None:
    """A program is stopped even if the robot reports that it is idle."""
    cases = run_cases(mutants()["idle-during-run"].wrong, *requirement_ids("4.8,4.9,4.16"))
    assert "4.8/4" in cases.violated
    assert not {"4/15", "4.16/2", "4.16/3"} & cases.violated
    assert "run.restore" not in cases
